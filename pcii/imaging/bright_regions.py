"""Where a section is bright: an outline that runs along the strongest edges.

Both methods use this. Roberts' cross (Muniraj et al. 2017, Eq. 8) finds how steep the section is, and
the outline settles where it is steepest. Levels follow from the photon noise.
"""

import numpy as np

DARK_SIGMAS = 2.0
BRIGHT_SIGMAS = 6.0
"""How far from the dark, in standard deviations of its noise, a pixel is surely dark or bright."""
NEARBY_PX = 25
SKIRT_SHARE = 1 / 3
"""What is below 1/3 of the brightest nearby (1/9 of its photons) may be its blurred skirt."""
EDGE_SMOOTHING_PX = 1.0
SMALLEST_REGION_PX = 100
MARGIN_PX = 40
"""What is shown or looked at around a thing, so that its outline may move."""


def roberts_magnitude(image: np.ndarray) -> np.ndarray:
    """Magnitude of Roberts' cross of an image (H, W), same shape (Eq. 8).

    The kernels are [[1, 0], [0, -1]] and [[0, 1], [-1, 0]] (Fig. 5). The result belongs to the
    corner between four pixels and is kept at their upper left one; borders continue the image.
    """
    padded = np.pad(image, ((0, 1), (0, 1)), mode="edge")
    down = padded[:-1, :-1] - padded[1:, 1:]
    up = padded[:-1, 1:] - padded[1:, :-1]
    return np.hypot(down, up)


def brightness(pooled: np.ndarray, samples_per_window: float) -> np.ndarray:
    """Photons of all colours of a pooled section (H, W, C), on a scale where their noise is uniform.

    The square root of a Poisson count has the variance 1/4 whatever its mean (Anscombe), so levels
    and gradients mean the same in bright and in dark places. One colour's share does not matter.
    """
    return np.sqrt(pooled.mean(axis=-1) * samples_per_window)


def foreground(bright: np.ndarray, edges: np.ndarray, subpixel: int = 1) -> np.ndarray:
    """What stands out of the dark, (H, W) bool; its outline runs along the ridges of `edges`.

    `bright` is from `brightness`, `edges` the Roberts magnitude of it. Pixels that are surely dark
    and pixels that are surely not are flooded along the edges until they meet (watershed). The dark
    is the lower quintile of the picture; its noise on the square-root scale is 1/2. Surely bright is
    what exceeds it by `BRIGHT_SIGMAS` and is no mere skirt of something brighter nearby. Lengths in pixels
    are `subpixel` times as many voxels.
    """
    from scipy.ndimage import gaussian_filter, maximum_filter, uniform_filter
    from skimage.segmentation import watershed

    above = (bright - np.quantile(bright, 0.2)) / 0.5
    nearby = maximum_filter(above, NEARBY_PX * subpixel)
    markers = np.zeros(bright.shape, dtype=np.int32)
    markers[above < DARK_SIGMAS] = 1
    markers[(above > BRIGHT_SIGMAS) & (above > SKIRT_SHARE * nearby)] = 2
    # Roberts' cross belongs to corners: the mean of a pixel's four corners belongs to the pixel.
    steepness = gaussian_filter(uniform_filter(edges, 2), EDGE_SMOOTHING_PX * subpixel)
    return watershed(steepness, markers) == 2


def outlined(
    pooled: np.ndarray, samples_per_window: float, smallest_px: int, subpixel: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Roberts magnitude of one pooled section (H, W, C), and what stands out in it, both (H, W).

    With `subpixel` = M these are of voxels that are M times finer; `smallest_px` still counts pixels.
    """
    bright = brightness(pooled, samples_per_window)
    edges = roberts_magnitude(bright)
    return edges, without_specks(foreground(bright, edges, subpixel), smallest_px * subpixel**2)


def without_specks(mask: np.ndarray, smallest_px: int) -> np.ndarray:
    """The mask without connected pieces, and without holes, of fewer than `smallest_px` pixels.

    The dark around everything is no hole, however small the picture.
    """
    if not mask.any():
        return mask
    return ~large_pieces(~large_pieces(mask, smallest_px), smallest_px)


def dilated(mask: np.ndarray, steps: int) -> np.ndarray:
    """The mask and what is within so many steps of it along rows and columns."""
    from scipy.ndimage import binary_dilation

    return np.asarray(binary_dilation(mask, iterations=steps), dtype=bool)


def box_around(mask: np.ndarray, room: tuple[int, int] = (MARGIN_PX, MARGIN_PX)) -> tuple[slice, slice]:
    """Rows and columns around a mask, with room above and below, left and right; all if it is empty."""
    if not mask.any():
        return slice(0, mask.shape[0]), slice(0, mask.shape[1])
    box = []
    for axis, size in enumerate(mask.shape):
        there = np.flatnonzero(mask.any(axis=1 - axis))
        box.append(slice(max(int(there[0]) - room[axis], 0), min(int(there[-1]) + 1 + room[axis], size)))
    return box[0], box[1]


def connected_pieces(mask: np.ndarray) -> np.ndarray:
    """Number of the connected piece (by edges) that each pixel belongs to, from 1; 0 outside."""
    from scipy.ndimage import label

    pieces = np.zeros(mask.shape, dtype=np.int32)
    label(mask, output=pieces)
    return pieces


def large_pieces(mask: np.ndarray, smallest_px: float) -> np.ndarray:
    """The mask without connected pieces of fewer than `smallest_px` pixels."""
    pieces = connected_pieces(mask)
    keep = np.bincount(pieces.ravel()) >= smallest_px
    keep[0] = False
    return keep[pieces]

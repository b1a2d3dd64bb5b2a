"""Bright regions of a section, with outlines along the strongest edges; operations on masks.

The gradient is that of Roberts' cross (Muniraj et al. 2017, Eq. 8), and the outline follows its ridges.
Levels follow from the photon noise.
"""

import numpy as np

DARK_SIGMAS = 2.0
BRIGHT_SIGMAS = 6.0
"""Markers: pixels below or above the background by this many standard deviations of its noise."""
NEARBY_PX = 25
BLUR_SHARE = 1 / 3
"""A pixel below 1/3 of the brightest nearby (1/9 of its photons) may be part of the blur of that one."""
EDGE_SMOOTHING_PX = 1.0
SMALLEST_REGION_PX = 100


def roberts_magnitude(image: np.ndarray) -> np.ndarray:
    """Magnitude of Roberts' cross of an image (H, W), same shape (Eq. 8).

    The kernels are [[1, 0], [0, -1]] and [[0, 1], [-1, 0]] (Fig. 5). The result belongs to the
    corner between four pixels and is kept at their upper left one; borders continue the image.

    >>> float(roberts_magnitude(np.array([[0.0, 4.0], [0.0, 3.0]]))[0, 0])
    5.0
    """
    padded = np.pad(image, ((0, 1), (0, 1)), mode="edge")
    down = padded[:-1, :-1] - padded[1:, 1:]
    up = padded[:-1, 1:] - padded[1:, :-1]
    return np.hypot(down, up)


def brightness(pooled: np.ndarray, samples_per_window: float) -> np.ndarray:
    """Photons of all colours of a pooled section (H, W, C), on a scale of uniform noise, (H, W).

    The square root of a Poisson count has the variance 1/4 whatever its mean (Anscombe), so levels
    and gradients mean the same in bright and in dark places.
    """
    return np.sqrt(pooled.mean(axis=-1) * samples_per_window)


def foreground(bright: np.ndarray, edges: np.ndarray, subpixel: int = 1) -> np.ndarray:
    """Mask of what is brighter than the background, (H, W) bool; its outline follows the ridges of `edges`.

    `bright` is from `brightness`, `edges` the Roberts magnitude of it. A watershed grows markers of the
    background and of the foreground until they meet. The level of the background is the lower quintile of
    the picture; its noise on the square-root scale is 1/2. A marker of the foreground exceeds it by
    `BRIGHT_SIGMAS` and cannot be the blur of something brighter nearby. Lengths in pixels are `subpixel`
    times as many voxels.
    """
    from scipy.ndimage import gaussian_filter, maximum_filter, uniform_filter
    from skimage.segmentation import watershed

    above = (bright - np.quantile(bright, 0.2)) / 0.5
    nearby = maximum_filter(above, NEARBY_PX * subpixel)
    markers = np.zeros(bright.shape, dtype=np.int32)
    markers[above < DARK_SIGMAS] = 1
    markers[(above > BRIGHT_SIGMAS) & (above > BLUR_SHARE * nearby)] = 2
    # Roberts' cross belongs to corners: the mean of a pixel's four corners belongs to the pixel.
    steepness = gaussian_filter(uniform_filter(edges, 2), EDGE_SMOOTHING_PX * subpixel)
    return watershed(steepness, markers) == 2


def outlined(
    pooled: np.ndarray, samples_per_window: float, smallest_px: int, subpixel: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Roberts magnitude of one pooled section (H, W, C), and its foreground without specks, both (H, W).

    With `subpixel` = M these are of voxels that are M times finer; `smallest_px` still counts pixels.
    """
    bright = brightness(pooled, samples_per_window)
    edges = roberts_magnitude(bright)
    return edges, without_specks(foreground(bright, edges, subpixel), smallest_px * subpixel**2)


def without_specks(mask: np.ndarray, smallest_px: int) -> np.ndarray:
    """The mask without connected components, and without holes, of fewer than `smallest_px` pixels.

    An empty mask stays empty, however small the picture.
    """
    if not mask.any():
        return mask
    return ~large_pieces(~large_pieces(mask, smallest_px), smallest_px)


def large_pieces(mask: np.ndarray, smallest_px: float) -> np.ndarray:
    """The mask without connected components (of four neighbours) of fewer than `smallest_px` pixels."""
    from scipy.ndimage import label

    pieces = np.zeros(mask.shape, dtype=np.int32)
    label(mask, output=pieces)
    keep = np.bincount(pieces.ravel()) >= smallest_px
    keep[0] = False
    return keep[pieces]

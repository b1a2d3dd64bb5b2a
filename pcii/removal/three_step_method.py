"""Removal of defocused points by the three steps of Muniraj et al. 2017, section 3.

1. Adaptive threshold on the variance of the non-zero samples (Eq. 7): in focus, the views' samples of
   a voxel differ by Poisson noise alone. The paper gives no T; here it is derived from the Poisson law.
2. Boundary detection by Roberts' cross (Eq. 8): the outlines of bright regions lie on its ridges, and ridges
   inside divide them into smaller regions.
3. Entropy criterion (Eq. 9): a region is in focus at the plane where its entropy is lowest. The paper does
   not say of which quantity h in Eq. 9 is the histogram. Here h is the share of the region's edge energy
   |G|^2 (step 2) in each pixel. In focus the energy is concentrated in few strong edges, so the entropy is
   low; out of focus the same edges are weak and wide, and photon noise remains, which is uniform.

docs/removal.md describes the choices that the paper leaves open, docs/theory.md has the equation of T, and
docs/experiments/three_step.md the measurements behind them.
"""

from dataclasses import dataclass, fields

import numpy as np

from pcii.base import InputError, on_pixels
from pcii.removal.watershed_pieces import cheapest_planes, pieces_along_ridges
from pcii.sections import (
    PROBE_STEPS_PX,
    extend,
    photons_around_a_photon,
    pooled_plane,
    reconstruct,
    section_window_px,
    truncated_poisson_variance,
    view_samples,
    with_probes,
)
from pcii.types import FocalPlanes, PhotonCounts, Sections, Segmented

PROBE_STEP_PX = min(abs(step) for step in PROBE_STEPS_PX)
LARGEST_BLUR_PX = max(abs(step) for step in PROBE_STEPS_PX) / 2
"""Half-extent, at the farthest probe plane, of the blur of a point in focus at a requested plane."""
WINDOW_CELLS = 4
PHOTONS_PER_SAMPLE = 10.0
LARGEST_CELL_PX = 8
"""Eq. 7 pools over 4 x 4 cells of a size at which a view has about 10 photons in them where the photons
are."""
SIGMAS = 3.0
"""By how many standard deviations of the sample variance T exceeds its expectation."""
FEWEST_SAMPLES = 8
"""With fewer non-zero samples than this a point is not removed."""
DARK_SIGMAS = 2.0
BRIGHT_SIGMAS = 6.0
"""Markers: pixels below or above the background by this many standard deviations of its noise."""
NEARBY_PX = 25
BLUR_SHARE = 1 / 3
"""A pixel below 1/3 of the brightest nearby (1/9 of its photons) may be part of the blur of that one."""
EDGE_SMOOTHING_PX = 1.0
"""Standard deviation by which edges are smoothed. If it is smaller, noise makes ridges of its own; if larger,
outlines are rounded."""
SMALLEST_REGION_PX = 100
"""Regions and holes of fewer pixels are left out. If it is smaller, noise leaves specks; if larger, small
objects are lost."""
BORDER_BITS = 0.1
"""Least gain in entropy, in bits per window of border, for which neighbouring regions get different
planes."""


@dataclass(frozen=True)
class ThreeStep:
    """The paper's removal as a `method` of `pcii.segment`; each step can be left out.

    Without `threshold` no point is removed for its variance. Without `boundary` every point with a photon in
    its window may remain, and the sub-images of the entropy are square tiles. Without `entropy` no region is
    removed for being sharper at another plane. Without all three, every point with a photon in its window
    remains at every plane.

    With `subpixel` = M outlines are located on voxels M times finer (section 3.1); a pixel is in focus if
    half of its voxels are. Raises `InputError` for a `subpixel` below 1.

    >>> ThreeStep(subpixel=2, entropy=False).name
    'three-step-subpixel-2-without-entropy'
    """

    subpixel: int = 1
    threshold: bool = True
    boundary: bool = True
    entropy: bool = True

    def __post_init__(self) -> None:
        M = self.subpixel
        if isinstance(M, bool) or not isinstance(M, int | np.integer) or M < 1:
            raise InputError(f"subpixel: expected a whole number of at least 1, got {M!r}")

    @property
    def name(self) -> str:
        """Name of the results: three-step, and the settings that differ from the defaults."""
        missing = [f"without-{step.name}" for step in fields(self) if getattr(self, step.name) is False]
        fine = [f"subpixel-{self.subpixel}"] if self.subpixel > 1 else []
        return "-".join(["three-step", *fine, *missing])

    def __call__(self, counts: PhotonCounts, requested: Sections) -> Segmented:
        """In-focus masks (Z, H, W) of the requested sections, with the maps of each step in `steps`.

        Step 1: `mean` and `variance` of the non-zero samples, `threshold` (T of Eq. 7), `answered` (where
        there are enough samples) and `kept`. Step 2: `edges` (Roberts magnitude), `bright` (inside its
        outlines), `regions` (their numbers, from 1). Step 3: `entropy` of each region at each plane in bits,
        0 outside, and `winner`, the plane of least entropy, -1 outside; from Z on these are probe planes.
        With `subpixel` = M > 1 `fine` holds the masks (Z, H M, W M) of the voxels.
        """
        planes = with_probes(requested.planes, clear_px=PROBE_STEP_PX)
        sections = extend(requested, counts, planes)
        requested_planes = range(len(requested.planes))
        cell_px = _cell_px(sections)
        step1 = [
            adaptive_threshold(counts, planes, p, cell_px, _tolerance_px(planes, p)) for p in requested_planes
        ]
        steps = {name: np.stack([maps[name] for maps in step1]) for name in step1[0]}

        window_px = section_window_px(sections)
        images = (brightness(sections, plane, window_px) for plane in range(len(planes)))
        edges = np.stack([roberts_magnitude(image).astype(np.float32) for image in images])
        del sections  # whose probe planes take memory: the masks are of the requested ones
        ridges = _ridges(edges)
        fine = np.stack([self._bright(counts, requested, p, window_px) for p in requested_planes])
        bright = _half_of_each_pixel(fine, self.subpixel)
        bright_at_any: np.ndarray = np.logical_or.reduce(bright)
        margin = int(LARGEST_BLUR_PX)
        highest_ridges = ridges[: len(bright)].max(axis=0)
        if self.boundary:
            regions = pieces_along_ridges(bright_at_any, highest_ridges, margin**2)
        else:
            regions = _tiles(bright_at_any, 2 * margin)
        steps |= {
            "edges": edges[: len(bright)],
            "bright": bright,
            "regions": np.broadcast_to(regions, bright.shape),
        }

        in_focus = np.ones_like(bright)
        if self.threshold:
            in_focus &= steps["kept"]
        if self.entropy:
            entropies = _edge_entropies(ridges, regions, margin)
            borders = highest_ridges if self.boundary else None
            winner = _planes_of_least_entropy(entropies, regions, borders, window_px)[regions]
            in_focus &= winner == np.arange(len(bright))[:, None, None]
            steps["entropy"] = entropies.T[: len(bright)][:, regions]
            steps["winner"] = np.broadcast_to(winner, bright.shape)
        if self.subpixel > 1:
            M = self.subpixel
            steps["fine"] = fine & in_focus.repeat(M, axis=1).repeat(M, axis=2)
        return Segmented(bright & in_focus, self.name, requested, steps)

    def _bright(self, counts: PhotonCounts, sections: Sections, plane: int, window_px: int) -> np.ndarray:
        """Step 2 on voxels M times finer, (H M, W M) bool; without it voxels with a photon near."""
        M = self.subpixel
        if M > 1:
            sections, plane = reconstruct(counts, sections.planes.take([plane]), subpixel=M), 0
            window_px = 2 * ((window_px * M - 1) // 2) + 1  # odd, and no wider than in pixels
        if not self.boundary:
            return pooled_plane(sections, plane, window_px).max(axis=-1) > 0
        return _outlined(brightness(sections, plane, window_px), M)


# Step 1


def adaptive_threshold(
    counts: PhotonCounts, planes: FocalPlanes, plane: int, cell_px: int, tolerance: float
) -> dict[str, np.ndarray]:
    """Step 1: where the variance of the non-zero samples is at most T (Eq. 7), with the maps it follows from.

    Maps (H, W): `mean`, `variance` and `threshold` float32, `kept` and `answered` bool. T is the variance of
    non-zero Poisson samples of the same mean, plus `SIGMAS` times the sampling error of a variance, about var
    sqrt(2 / (n - 1)) for n samples, plus the variance due to the slope of the section, over shifts that a
    surface in focus may have: `tolerance` px either way and the rounding to whole pixels, both uniform.
    Points with fewer than `FEWEST_SAMPLES` are kept, and so are rejected regions smaller than a window of
    cells.
    """
    samples = view_samples(counts, planes, plane, cell_px=cell_px, window_cells=WINDOW_CELLS)
    noise = truncated_poisson_variance(samples.mean)
    noise = noise * (1 + SIGMAS * np.sqrt(2 / np.maximum(samples.number - 1, 1)))
    # The two diagonal differences of Roberts' cross square to twice the squared slope per cell.
    slope2 = roberts_magnitude(samples.mean) ** 2 / (2 * cell_px**2)
    limit = noise + slope2 * (tolerance**2 / 3 + 1 / 12)
    known = samples.number >= FEWEST_SAMPLES
    # Of many windows a few exceed T by chance, and with them the cells that share their samples.
    rejected = _large_pieces(known & (samples.variance > limit), WINDOW_CELLS**2)
    maps = {
        "mean": samples.mean.astype(np.float32),
        "variance": samples.variance.astype(np.float32),
        "threshold": limit.astype(np.float32),
        "answered": known,
        "kept": ~rejected,
    }
    return {name: on_pixels(cells, cell_px, counts.grid.shape_HW) for name, cells in maps.items()}


def _tolerance_px(planes: FocalPlanes, plane: int) -> float:
    """Blur half-extent halfway to the nearest other plane: points closer to this plane may remain."""
    apart = np.abs(planes.total_disparity_px - planes.total_disparity_px[plane])
    others = apart[apart > 0]
    return float(others.min()) / 4 if others.size else 0.0


def _cell_px(sections: Sections) -> int:
    """Cell size at which a window holds `PHOTONS_PER_SAMPLE` photons per view where the photons are."""
    per_view = photons_around_a_photon(sections) / sections.grid.view_count
    if per_view == 0:
        return LARGEST_CELL_PX
    window_px = np.sqrt(PHOTONS_PER_SAMPLE / per_view)
    return int(np.clip(np.ceil(window_px / WINDOW_CELLS), 1, LARGEST_CELL_PX))


# Step 2


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


def brightness(sections: Sections, plane: int, window_px: int) -> np.ndarray:
    """Photons of all colours in the window around each pixel, on a scale of uniform noise, (H, W).

    The square root of a Poisson count has the variance 1/4 whatever its mean (Anscombe), so levels
    and gradients mean the same in bright and in dark places.
    """
    coverage = sections.coverage[plane]
    samples = window_px**2 * float(coverage.mean()) * coverage.shape[-1]
    return np.sqrt(pooled_plane(sections, plane, window_px).mean(axis=-1) * samples)


def _ridges(edges: np.ndarray, subpixel: int = 1) -> np.ndarray:
    """Smoothed Roberts magnitudes (..., H, W), of pixels or of voxels `subpixel` times finer."""
    from scipy.ndimage import gaussian_filter, uniform_filter

    # Roberts' cross belongs to corners: the mean of a pixel's four corners belongs to the pixel.
    axes = -2, -1
    return gaussian_filter(uniform_filter(edges, 2, axes=axes), EDGE_SMOOTHING_PX * subpixel, axes=axes)


def _outlined(bright: np.ndarray, subpixel: int = 1) -> np.ndarray:
    """Mask of what is brighter than the background, (H, W) bool; its outline follows the ridges of edges.

    `bright` is from `brightness`. A watershed grows markers of the background and of the foreground until
    they meet. The level of the background is the lower quintile of the picture; its noise on the square-root
    scale is 1/2. A marker of the foreground exceeds it by `BRIGHT_SIGMAS` and cannot be the blur of something
    brighter nearby. Regions and holes below `SMALLEST_REGION_PX` are left out. Lengths in pixels are
    `subpixel` times as many voxels.
    """
    from scipy.ndimage import maximum_filter
    from skimage.segmentation import watershed

    above = (bright - np.quantile(bright, 0.2)) / 0.5
    nearby = maximum_filter(above, NEARBY_PX * subpixel)
    markers = np.zeros(bright.shape, dtype=np.int32)
    markers[above < DARK_SIGMAS] = 1
    markers[(above > BRIGHT_SIGMAS) & (above > BLUR_SHARE * nearby)] = 2
    mask = watershed(_ridges(roberts_magnitude(bright), subpixel), markers) == 2
    return without_specks(mask, SMALLEST_REGION_PX * subpixel**2)


def without_specks(mask: np.ndarray, smallest_px: int = SMALLEST_REGION_PX) -> np.ndarray:
    """The mask without connected components, and without holes, of fewer than `smallest_px` pixels.

    An empty mask stays empty, however small the picture.
    """
    if not mask.any():
        return mask
    return ~_large_pieces(~_large_pieces(mask, smallest_px), smallest_px)


def _large_pieces(mask: np.ndarray, smallest_px: float) -> np.ndarray:
    """The mask without connected components (of four neighbours) of fewer than `smallest_px` pixels."""
    from scipy.ndimage import label

    pieces = np.zeros(mask.shape, dtype=np.int32)
    label(mask, output=pieces)
    keep = np.bincount(pieces.ravel()) >= smallest_px
    keep[0] = False
    return keep[pieces]


def _half_of_each_pixel(fine: np.ndarray, M: int) -> np.ndarray:
    """Pixels (Z, H, W) of which at least half of the M x M voxels are set."""
    Z, H, W = fine.shape
    voxels = fine.reshape(Z, H // M, M, W // M, M)
    return 2 * voxels.sum(axis=(2, 4), dtype=np.int64) >= M * M


def _tiles(mask: np.ndarray, side_px: int) -> np.ndarray:
    """Square tiles of a mask (H, W), numbered from 1; 0 outside the mask."""
    row, col = (np.arange(size) // side_px for size in mask.shape)
    numbers = 1 + row[:, None] * (col[-1] + 1) + col
    return np.where(mask, numbers, 0).astype(np.int32)


# Step 3


def _edge_entropies(edges: np.ndarray, regions: np.ndarray, margin_px: int) -> np.ndarray:
    """Entropy in bits of every region (number, from 1) at every plane, (N + 1, P) float64; row 0 is 0.

    `edges` (P, H, W) is the Roberts magnitude at each plane and `regions` (H, W) the numbers. A region is
    dilated by a square of half-width `margin_px`, so that it has the blurred object at all planes, too. A
    region without edges at a plane has the largest possible entropy, log2 of its number of pixels.

    >>> sharp, blurred, none = [[1.0, 0.0], [0.0, 0.0]], [[1.0, 1.0], [1.0, 1.0]], [[0.0, 0.0], [0.0, 0.0]]
    >>> edges = np.array([sharp, blurred, none])
    >>> _edge_entropies(edges, np.ones((2, 2), dtype=int), margin_px=0)[1].tolist()
    [0.0, 2.0, 2.0]
    """
    from scipy.ndimage import find_objects, maximum_filter
    from scipy.special import xlogy

    energy = edges.astype(np.float64) ** 2
    information = xlogy(energy, energy)
    entropies = np.zeros((int(regions.max()) + 1, len(edges)))
    for number, box in enumerate(find_objects(regions), start=1):
        if box is None:  # a square tile without light has no region
            continue
        rows, cols = (slice(max(s.start - margin_px, 0), s.stop + margin_px) for s in box)
        grown = np.asarray(maximum_filter(regions[rows, cols] == number, 2 * margin_px + 1), dtype=bool)
        total = energy[:, rows, cols].sum(axis=(1, 2), where=grown)
        weighted = information[:, rows, cols].sum(axis=(1, 2), where=grown)
        nats = np.log(np.maximum(total, 1e-300)) - weighted / np.maximum(total, 1e-300)
        entropies[number] = np.where(total > 0, nats, np.log(grown.sum())) / np.log(2)
    return entropies


def _planes_of_least_entropy(
    entropies: np.ndarray, regions: np.ndarray, ridges: np.ndarray | None, window_px: int
) -> np.ndarray:
    """Plane at which each region is in focus, (N + 1,) int64; -1 for number 0.

    Minimises the sum over regions of entropy times independent windows of `window_px`, plus `BORDER_BITS` for
    each window of border, along the `ridges` (H, W), between regions of different planes. Without `ridges`
    each region has the plane of its least entropy.
    """
    if ridges is None:
        planes = np.argmin(entropies, axis=1)
        planes[0] = -1
        return planes
    windows = np.bincount(regions.ravel(), minlength=len(entropies)) / window_px**2
    return cheapest_planes(regions, ridges, windows[:, None] * entropies, BORDER_BITS / window_px)

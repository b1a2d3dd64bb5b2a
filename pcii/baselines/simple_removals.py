"""Textbook methods of removal to compare others with: by brightness, by variance, by sharpness.

Each uses a single cue, in windows whose size follows from the number of photons. All work on the square root
of the photons in a window, whose noise does not depend on the brightness (see
`pcii.imaging.bright_regions.brightness`).
"""

import numpy as np

from pcii.imaging.blocks import on_pixels
from pcii.imaging.bright_regions import SMALLEST_REGION_PX, without_specks
from pcii.imaging.bright_regions import brightness as root_photons
from pcii.sections.photon_statistics import pooled_estimate, section_window_px, view_samples
from pcii.sections.reconstruction import extend, view_coverage, with_probes
from pcii.types.estimates import Segmented
from pcii.types.focal_planes import FocalPlanes
from pcii.types.photon_counts import PhotonCounts
from pcii.types.section_stack import Sections

NOISE = 0.5
"""Standard deviation of the square root of a Poisson count."""
LEAST_CONTRAST_SIGMAS = 4.0
"""Least contrast of the two classes: noise divided at its mean has classes 2 sqrt(2 / pi) = 1.6 sigma
apart."""
WINDOW_CELLS = 4
PHOTONS_PER_VIEW = 10.0
LARGEST_CELL_PX = 8
"""The variance test pools over 4 x 4 cells, as large as needed for about 10 photons of a view."""
POISSON_QUANTILE = 0.999
"""The variance test rejects values that Poisson noise exceeds in one window of a thousand."""
FOCUS_WINDOW = 6
"""Sharpness is summed over this many pooling windows along each axis."""


def brightness(counts: PhotonCounts, sections: Sections) -> Segmented:
    """Points brighter than Otsu's threshold on the pooled section are in focus.

    Otsu 1979. Where the two classes differ by no more than noise explains, nothing is in focus.
    """
    bright = _bright(_root_photons(sections, section_window_px(sections)))
    return Segmented(bright, "brightness", sections)


def variance(counts: PhotonCounts, sections: Sections) -> Segmented:
    """Bright points whose variance over the views is that of Poisson noise are in focus.

    Fisher's index of dispersion: sum (x - mean)^2 / mean over the V views of a point is distributed as
    chi-square with V - 1 degrees of freedom if all views have the same rate. A sample x is the photons of one
    view in a square window of even side, which has equally many pixels of each Bayer colour, large enough for
    about 10 photons where the section is bright. `steps` holds `bright` and `even`, the outcome of the test.
    """
    window_px = section_window_px(sections)
    bright = _bright(_root_photons(sections, window_px))
    cell_px = _cell_px(pooled_estimate(sections, window_px), bright)
    even = np.stack([_is_even(counts, sections.planes, p, cell_px) for p in range(len(bright))])
    return Segmented(bright & even, "variance", sections, {"bright": bright, "even": even})


def shape_from_focus(counts: PhotonCounts, sections: Sections) -> Segmented:
    """Bright points that are sharper at z than at any other requested or probe plane are in focus.

    Nayar and Nakagawa 1994: sharpness is the modified Laplacian |2 I - I(left) - I(right)| + |2 I - I(above)
    - I(below)|, one pooling window apart, summed over a window where it exceeds its noise. `steps` holds
    `bright` and `sharpness`.
    """
    compared = extend(sections, counts, with_probes(sections.planes))
    window_px = section_window_px(compared)
    image = _root_photons(compared, window_px)
    sharpness = np.stack([sum_modified_laplacian(plane, window_px) for plane in image])
    count = len(sections.planes)
    bright = _bright(image[:count])
    sharpest = np.argmax(sharpness, axis=0) == np.arange(count)[:, None, None]
    steps = {"bright": bright, "sharpness": sharpness[:count]}
    return Segmented(bright & sharpest, "shape-from-focus", sections, steps)


def sum_modified_laplacian(image: np.ndarray, step_px: int) -> np.ndarray:
    """Sharpness (H, W) of an image (H, W) whose noise is `NOISE`, its samples `step_px` apart.

    Nayar and Nakagawa 1994, Eqs. 5 and 6. Values below the noise of a modified Laplacian, sqrt(6) times that
    of a sample, are not added; beyond its borders the image is continued by its outermost pixels.
    """
    from scipy.ndimage import correlate1d, uniform_filter

    kernel = np.zeros(2 * step_px + 1)
    kernel[[0, step_px, -1]] = -1, 2, -1
    sharp = sum(np.abs(correlate1d(image, kernel, axis, mode="nearest")) for axis in (0, 1))
    return uniform_filter(np.where(sharp > np.sqrt(6) * NOISE, sharp, 0.0), FOCUS_WINDOW * step_px + 1)


def _root_photons(sections: Sections, window_px: int) -> np.ndarray:
    """Square root of the photons of a pooling window, (Z, H, W)."""
    pooled = pooled_estimate(sections, window_px)
    samples = (window_px**2 * float(plane.mean()) * plane.shape[-1] for plane in sections.coverage)
    return np.stack([root_photons(*pair) for pair in zip(pooled, samples, strict=True)])


def _bright(image: np.ndarray) -> np.ndarray:
    """Pixels above Otsu's threshold of each plane, (Z, H, W) bool, without small regions."""
    from skimage.filters import threshold_otsu

    masks: list[np.ndarray] = []
    for plane in image:
        # The range bounds the contrast of any two classes; Otsu's histogram needs two different values.
        if np.ptp(plane) <= LEAST_CONTRAST_SIGMAS * NOISE:
            masks.append(np.zeros(plane.shape, dtype=bool))
            continue
        mask = plane > threshold_otsu(plane)
        contrast = plane[mask].mean() - plane[~mask].mean() if mask.any() else 0.0
        is_significant = contrast > LEAST_CONTRAST_SIGMAS * NOISE
        masks.append(without_specks(mask & is_significant, SMALLEST_REGION_PX))
    return np.stack(masks)


def _cell_px(pooled: np.ndarray, bright: np.ndarray) -> int:
    """Cell size at which a window of `WINDOW_CELLS` has about 10 photons per view where it is bright."""
    if not bright.any():
        return LARGEST_CELL_PX
    per_pixel = float(pooled.mean(axis=-1)[bright].mean())
    window_px = np.sqrt(PHOTONS_PER_VIEW / per_pixel)
    return int(np.clip(np.ceil(window_px / WINDOW_CELLS), 1, LARGEST_CELL_PX))


def _is_even(counts: PhotonCounts, planes: FocalPlanes, plane: int, cell_px: int) -> np.ndarray:
    """Where the variance over the views is that of Poisson noise, or 0, (H, W) bool."""
    from scipy.special import chdtri

    samples = view_samples(counts, planes, plane, cell_px=cell_px, window_cells=WINDOW_CELLS)
    views = _views(planes.take([plane]), cell_px)
    total = samples.number * samples.mean
    squares = np.maximum(samples.number - 1, 0) * samples.variance + samples.mean * total
    dispersion = views * squares / np.maximum(total, 1) - total
    # chdtri is the inverse of the upper tail.
    even = dispersion <= chdtri(np.maximum(views - 1, 1), 1 - POISSON_QUANTILE)
    return on_pixels(even, cell_px, counts.grid.shape_HW)


def _views(planes: FocalPlanes, cell_px: int) -> np.ndarray:
    """How many views cover the middle of each cell of the first plane, at least 1."""
    grid = planes.grid
    coverage = view_coverage(planes)[0].astype(np.float64)
    rows, cols = (np.arange(0, size, cell_px) + cell_px // 2 for size in grid.shape_HW)
    middle = np.ix_(np.minimum(rows, grid.height - 1), np.minimum(cols, grid.width - 1))
    return np.maximum(coverage[middle], 1)

"""Textbook methods of removal to compare others with: by brightness, and by sharpness.

Each uses a single cue, in windows whose size follows from the number of photons. All work on the square root
of the photons in a window, whose noise does not depend on the brightness (see
`pcii.removal.three_step.bright_regions.brightness`).
"""

import numpy as np

from pcii.removal.three_step import SMALLEST_REGION_PX, without_specks
from pcii.removal.three_step import brightness as root_photons
from pcii.sections import extend, pooled_estimate, section_window_px, with_probes
from pcii.types import PhotonCounts, Sections, Segmented

NOISE = 0.5
"""Standard deviation of the square root of a Poisson count."""
LEAST_CONTRAST_SIGMAS = 4.0
"""Least contrast of the two classes: noise divided at its mean has classes 2 sqrt(2 / pi) = 1.6 sigma
apart."""
FOCUS_WINDOW = 6
"""Sharpness is summed over this many pooling windows along each axis."""


def brightness(counts: PhotonCounts, sections: Sections) -> Segmented:
    """Points brighter than Otsu's threshold on the pooled section are in focus.

    Otsu 1979. Where the two classes differ by no more than noise explains, nothing is in focus.
    """
    bright = _bright(_root_photons(sections, section_window_px(sections)))
    return Segmented(bright, "brightness", sections)


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

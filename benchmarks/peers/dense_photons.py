"""Photon counts by rendering: every pixel with some samples, scaled to the budget, and Poisson draws."""

import numpy as np

from pcii.types import Light, photon_rates, scope_energies, sense
from simgen.photons import Capture
from simgen.renderer import render_view


def rendered_mosaic(capture: Capture, view: int, samples_per_pixel: int, seed: int) -> np.ndarray:
    """Radiance (H, W) that each pixel of a view sees in its own colour."""
    k, l = divmod(view, capture.grid.cols)
    image = render_view(
        capture.render_scene, capture.grid, k, l, samples_per_pixel=samples_per_pixel, seed=seed
    )
    return sense(image, capture.cfa)


def drawn_counts(mosaic: np.ndarray, cfa: str | None, budget: float, rng: np.random.Generator) -> np.ndarray:
    """Counts (H, W) of a view, drawn with a mean of `budget` photons."""
    rates = photon_rates(mosaic, cfa, Light(budget), scope_energies(mosaic, cfa, "view"))
    return rng.poisson(rates)

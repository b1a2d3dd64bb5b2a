"""How photon counts will be made: thinned one by one, or drawn from rendered views, whichever costs less.

Neither has rendering noise to speak of: a probe of the light forecasts how many samples a view needs
(`light_probe`). Each view is rendered in two halves, whose difference tells the noise that there is (see
`draw_from_views`).
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from pcii.base.errors import InputError
from simgen.photons.bright_light import LEAST_SHARE, BrightLight
from simgen.photons.capture import Capture
from simgen.photons.exploration import Plan, explore
from simgen.photons.light_probe import Probe, probe
from simgen.photons.thinning import MAX_SINGLE_PHOTONS
from simgen.spec.recipe import MOST_PATHS

PHOTON_COST, SAMPLE_COST, PIXEL_COST = 1.5, 0.065, 0.015
"""Microseconds for a photon drawn by thinning, and for a sample and a pixel of a dense view, as measured by
`make bench` on two cores; only their ratios matter."""
SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST = 77.0, 0.3
"""The same without a compiled backend."""
UNBOUNDED = "rare light paths, as by mirrors, are too bright for single photons"
PROBE_SEED = 0
"""The probe measures the scene, and its paths enter no data. With one seed for all, recipes that differ in
nothing else are made alike: all with the origins of photons or all without."""
DEPTH_STEPS = 64
"""Depths are rounded to equal steps of disparity, this many up to the nearest."""
MAX_THINNED_PHOTONS = 1e10
"""Largest number of photons that are thinned, which takes two cores four hours, as a hundred views of
`MOST_PATHS` do."""


def plan_counts(
    capture: Capture,
    kind: str,
    min_samples: int = 1,
    *,
    may_explore: Callable[[Plan], bool] = lambda _: True,
) -> Plan:
    """Thin, or render densely, whichever takes less time for counts without rendering noise.

    Thinning takes time with the photons. Dense rendering takes it with the pixels and with the samples that
    each needs, which are more the more light there is. A probe of the light tells how many, unless a budget
    is so small that one sample for each pixel takes longer than all its photons. What is to be thinned is
    explored first, if it `may_explore` (memory may not suffice), and rendered where the light has no bound.
    The seed has no part in it (see `PROBE_SEED`). `kind` is that of the backend; views that are rendered in
    any case have `min_samples` per pixel. Raises `InputError` for nested budgets of too many photons, and
    for more photons than can be made in either way.
    """
    budget, why_rendered = capture.budget_per_view, capture.render_scene.why_rendered
    is_small = budget is not None and _are_few(capture, budget) and _thins(capture, kind, budget, min_samples)
    if budget is not None and is_small and not why_rendered:
        plan = Plan(True, min_samples, budget, depths_mm=_few_depths_mm(capture.coarse_z_mm))
    else:
        plan = _plan_by_probe(capture, kind, min_samples, why_rendered)
    if not plan.thins or not may_explore(plan):
        return plan
    explored = explore(capture, plan)
    if explored.thins:
        return explored
    return _plan_by_probe(capture, kind, min_samples, UNBOUNDED, explored.bright_light)


def _thins(capture: Capture, kind: str, photons: float, samples: int) -> bool:
    """Whether to thin a view's photons takes less time than to render it with so many samples per pixel."""
    photon_cost, sample_cost = PHOTON_COST, SAMPLE_COST
    if kind == "scalar":
        photon_cost, sample_cost = SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST
    return photon_cost * photons <= (sample_cost * samples + PIXEL_COST) * _pixels(capture)


def _are_few(capture: Capture, photons: float) -> bool:
    """Whether so many photons in each view can be kept one by one."""
    return photons * capture.grid.view_count <= MAX_SINGLE_PHOTONS


def _pixels(capture: Capture) -> int:
    return capture.grid.height * capture.grid.width


def _plan_by_probe(
    capture: Capture, kind: str, min_samples: int, why_rendered: str, found: Sequence[BrightLight] = ()
) -> Plan:
    """The cheaper way, or with a reason `why_rendered` the dense one; see `probe` for what was `found`."""
    probed, pixels, views = probe(capture, PROBE_SEED, found), _pixels(capture), capture.grid.view_count
    photons, gain = _photons_and_gain(capture, probed)
    samples = max(probed.samples_for(gain, capture.budget_pixels), min_samples)
    if capture.photons.nested and not _are_few(capture, photons):
        raise InputError(
            f"photons.nested: {photons * views:.3g} photons are too many to be told apart; "
            f"at most {MAX_SINGLE_PHOTONS} can be"
        )
    # Where the virtual centre sees no light there may be none at all, which rendered views show at once.
    may_thin = not why_rendered and probed.mean > 0
    max_thinned = MAX_THINNED_PHOTONS / views if may_thin else 0.0
    max_samples = (MOST_PATHS - 1) // pixels
    is_better = _thins(capture, kind, photons, samples) or samples > max_samples
    thins = may_thin and photons <= max_thinned and is_better
    if not thins and samples > max_samples:
        most = 0.95 * max(max_thinned, photons * max_samples / samples)  # two digits are off by up to 5 %
        name = "exposure" if capture.photons.scope == "exposure" else "photons.budget"
        raise InputError(
            f"{name}: {photons:.3g} photons per view are more than can be made without rendering noise; "
            f"at most {most:.2g} can be{probed.why_noisy(pixels)}"
        )
    budget_pixels, least_light = capture.budget_pixels, LEAST_SHARE * probed.mean * pixels
    return Plan(
        thins,
        samples,
        photons,
        keeps_origins=_are_few(capture, photons),
        why_rendered=why_rendered,
        noise=probed.photon_noise(gain, samples),
        normaliser_error=0.0 if budget_pixels is None else probed.light_error(samples * budget_pixels),
        depths_mm=_few_depths_mm(capture.coarse_z_mm) if thins else (),
        bright_light=tuple(row for row in probed.bright_light if row.light >= least_light),
    )


def _photons_and_gain(capture: Capture, probed: Probe) -> tuple[float, float]:
    """Photons of a view and those that a pixel catches of a unit of radiance, as seen from the centre."""
    if capture.photons_per_radiance is not None:
        return capture.photons_per_radiance * probed.mean * _pixels(capture), capture.photons_per_radiance
    budget = capture.budget_per_view
    assert budget is not None
    return budget, budget / (_pixels(capture) * probed.mean) if probed.mean > 0 else 0.0


def _few_depths_mm(z_mm: np.ndarray) -> tuple[float, ...]:
    """Depths (N,) in mm rounded to `DEPTH_STEPS` at most; inf where there is nothing."""
    nearest = float(z_mm.min())
    if not nearest < math.inf:
        return (math.inf,)
    steps = np.unique(np.rint(DEPTH_STEPS * nearest / z_mm.astype(np.float64)))
    return tuple((DEPTH_STEPS * nearest / steps[steps > 0]).tolist())

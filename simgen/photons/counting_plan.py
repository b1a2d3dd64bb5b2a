"""How photon counts will be made: thinned one by one or drawn from rendered views, and what led to it."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from pcii.base.errors import InputError
from pcii.core.bayer import channel_count
from pcii.core.camera_grid import CameraGrid
from simgen.cameras.rig import Rig
from simgen.photons.candidates import Setup
from simgen.photons.exploration import Exploration, explore
from simgen.photons.rendering_noise import Probe, first_hit_depths_mm, probe
from simgen.spec.recipe import MOST_PATHS, Photons

ROUNDING = 1.05
"""Two digits are off by up to 5 %: what is said to fit, divided by this before it is rounded, does so."""
PHOTON_COST, SAMPLE_COST, PIXEL_COST = 1.5, 0.065, 0.015
"""Microseconds for a photon drawn by thinning, and for a sample and a pixel of a dense view, as measured by
`make bench` on two cores; only their ratios matter."""
SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST = 77.0, 0.3
"""The same without a compiled backend."""
UNBOUNDED = "rare light paths, as by mirrors, are too bright for single photons"
PROBE_SEED = 0
"""The probe measures the scene, and its paths enter no data. With one seed for all, recipes that differ in
nothing else are made alike: all with the origins of photons or all without."""
MOST_SINGLE_PHOTONS = 1 << 25
"""So many photons are kept one by one at most; each takes some 200 bytes. More are drawn in the same way, but
only counted."""
MOST_THINNED_PHOTONS = 1e10
"""So many are drawn at most, which takes two cores four hours, as a hundred views of `MOST_PATHS` do."""


def two_digits(value: float) -> str:
    """A number with two digits.

    >>> two_digits(1234.0), two_digits(0.0456)
    ('1200', '0.046')
    """
    return f"{float(f'{value:.2g}'):g}"


@dataclass(frozen=True, eq=False)
class Capture:
    """What decides which photons arrive where: cameras, Bayer pattern, budget or exposure, and the seed.

    `photons_per_radiance` are those that a pixel catches of a unit of radiance; None unless photons are
    counted over an exposure.
    """

    rig: Rig
    cfa: str | None
    photons: Photons
    photons_per_radiance: float | None
    seed: int

    @property
    def grid(self) -> CameraGrid:
        """The cameras as they ought to be."""
        return self.rig.grid


@dataclass(frozen=True)
class Plan:
    """How the counts will be made, and what led to it."""

    thins: bool
    samples: int
    """Samples per pixel of the dense views that the counts are drawn from, or would need at least."""
    photons_per_view: float
    keeps_origins: bool = True
    """Whether photons are few enough to be kept one by one, each with its origin, if they are thinned."""
    why_rendered: str = ""
    """A clause on why photons cannot be thinned, whatever that costs; "" if they could be."""
    noise: float = 0.0
    """Variance that rendering adds to dense counts, as a share of their Poisson variance."""
    normaliser_error: float = 0.0
    """Standard error of the light that a dense view's budget is divided by, as a share of it."""
    depths_mm: tuple[float, ...] = ()
    """Some of the depths that the corner cameras see, if photons are thinned."""
    explored: Exploration | None = field(default=None, compare=False)
    """What is known of the light, if photons are thinned."""


def plan(
    capture: Capture,
    setup: Setup,
    kind: str,
    least_samples: int = 1,
    *,
    may_explore: Callable[[Plan], bool] = lambda _: True,
) -> Plan:
    """Thin, or render densely, whichever takes less time for counts without rendering noise.

    Thinning takes time with the photons. Dense rendering takes it with the pixels and with the samples that
    each needs, which are more the more light there is. A probe of the light tells how many, unless a budget
    is so small that one sample for each pixel takes longer than all its photons. What is to be thinned is
    explored first, if it `may_explore` (memory may not suffice), and rendered where the light has no bound.
    The seed has no part in it (see `PROBE_SEED`). `kind` is that of the backend; views that are rendered in
    any case have `least_samples` per pixel. Raises `InputError` for nested budgets of too many photons, and
    for more photons than can be made in either way.
    """
    if setup.render_scene.why_rendered:
        return _cheaper_way(capture, setup, kind, least_samples, why_rendered=setup.render_scene.why_rendered)
    made = _cheaper_way(capture, setup, kind, least_samples)
    if not made.thins or not may_explore(made):
        return made
    explored = explore(setup, capture.photons, capture.photons_per_radiance)
    if not explored.is_bounded:
        return _cheaper_way(capture, setup, kind, least_samples, why_rendered=UNBOUNDED)
    return replace(made, explored=explored)


def _cheaper_way(
    capture: Capture, setup: Setup, kind: str, least_samples: int, why_rendered: str = ""
) -> Plan:
    render_scene = setup.render_scene
    grid = capture.grid
    pixels = grid.height * grid.width
    photon_cost, sample_cost = PHOTON_COST, SAMPLE_COST
    if kind == "scalar":
        photon_cost, sample_cost = SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST

    def is_cheaper(photons_per_view: float, samples: int) -> bool:
        return photon_cost * photons_per_view <= (sample_cost * samples + PIXEL_COST) * pixels

    def are_few(photons_per_view: float) -> bool:
        return photons_per_view * grid.view_count <= MOST_SINGLE_PHOTONS

    per_view = _budget_per_view(capture)
    if (
        per_view is not None
        and not why_rendered
        and are_few(per_view)
        and is_cheaper(per_view, least_samples)
    ):
        depths_mm = first_hit_depths_mm(render_scene, grid)
        return Plan(True, least_samples, per_view, depths_mm=depths_mm)
    probed = probe(render_scene, grid, capture.cfa, PROBE_SEED)
    per_view, gain = _photons(capture, probed)
    scope_pixels = _scope_pixels(capture)
    samples = max(probed.samples_for(gain, scope_pixels), least_samples)
    if capture.photons.nested and not are_few(per_view):
        raise InputError(
            f"photons.nested: {per_view * grid.view_count:.3g} photons are too many to be told apart; "
            f"at most {MOST_SINGLE_PHOTONS} can be"
        )
    # Where the virtual centre sees no light there may be none at all, which rendered views show at once.
    may_thin = not why_rendered and probed.mean > 0
    most_thinned = MOST_THINNED_PHOTONS / grid.view_count if may_thin else 0.0
    most_samples = (MOST_PATHS - 1) // pixels
    is_better = is_cheaper(per_view, samples) or samples > most_samples
    thins = may_thin and per_view <= most_thinned and is_better
    if not thins and samples > most_samples:
        raise _too_many_photons(capture, per_view, max(most_thinned, per_view * most_samples / samples))
    return Plan(
        thins=thins,
        samples=samples,
        photons_per_view=per_view,
        keeps_origins=are_few(per_view),
        why_rendered=why_rendered,
        noise=probed.photon_noise(gain, samples),
        normaliser_error=0.0 if scope_pixels is None else probed.light_error(samples * scope_pixels),
        depths_mm=first_hit_depths_mm(render_scene, grid) if thins else (),
    )


def _too_many_photons(capture: Capture, per_view: float, most_per_view: float) -> InputError:
    """That so many photons of a view cannot be made exactly, and how many of them can."""
    what, number, most = "exposure: {:.3g} photons per view", per_view, most_per_view
    if capture.photons.scope != "exposure":
        what, number = "photons.budget: {:g} photons", capture.photons.budget
        most *= number / per_view
    return InputError(
        f"{what.format(number)} are more than can be made without rendering noise; at most "
        f"{two_digits(most / ROUNDING)} can be"
    )


def _budget_per_view(capture: Capture) -> float | None:
    """Photons of a view that a budget asks for; None for an exposure."""
    scopes = {"view": 1.0, "channel": float(channel_count(capture.cfa)), "scene": 1 / capture.grid.view_count}
    share = scopes.get(capture.photons.scope)
    return None if share is None else capture.photons.budget * share


def _photons(capture: Capture, probed: Probe) -> tuple[float, float]:
    """Photons that a view is expected to have, and those of a pixel and a unit of radiance.

    For a budget the second is estimated from what the virtual centre sees, for an exposure the first.
    """
    gain, per_view = capture.photons_per_radiance, _budget_per_view(capture)
    pixels = capture.grid.height * capture.grid.width
    if per_view is None:
        assert gain is not None
        return gain * probed.mean * pixels, gain
    return per_view, per_view / (pixels * probed.mean) if probed.mean > 0 else 0.0


def _scope_pixels(capture: Capture) -> int | None:
    """Pixels over which a budget is counted, of the rarest colour at worst; None without a budget."""
    grid = capture.grid
    pixels = grid.height * grid.width
    by_colour = max(pixels // 4, 1) if capture.cfa is not None else pixels
    scopes = {"view": pixels, "channel": by_colour, "scene": pixels * grid.view_count}
    return scopes.get(capture.photons.scope)

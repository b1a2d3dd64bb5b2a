"""Bright light that few paths meet: what holds it, how much it is, and where to aim at it.

Light of the radiance L that adds F to the sum of radiance over a film of P pixels fills F / L of them, so R
paths from the cameras meet it R F / (L P) times on average, however it reaches them: straight, by mirrors,
through glass, or scattered by a surface that few paths see it from. F is measured from the lamp's side, where
nothing is too small to be met (`light_tracing`). What holds a share of the light that matters and is met too
rarely to be sure of is aimed at, or forecast as noise of rendered views.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from simgen.base import join_rows, take_rows
from simgen.base import random_streams as seeds
from simgen.photons.candidates import (
    EXPLORATION_SEED,
    CandidateSampler,
    Capture,
    FilmPoints,
    is_on_film,
    nothing,
)
from simgen.photons.emission_sampler import EmissionSampler
from simgen.photons.majorant import Samples
from simgen.renderer import Arrivals, LampTracer

LEAST_SHARE = 0.01
"""Smallest share of a film's light that bright light is looked for: the noise that rendered views may have.
If it is larger, more light may be missing; if it is smaller, more is searched and refused."""
SURE_HITS = 20.0
"""Light that this many paths meet on average is taken as met: that none of them meets it has a probability of
2e-9. If it is smaller, light may be missed; if it is larger, more is aimed at or refused."""
SURVEY_POINTS = 1 << 12
"""Points of lamps at which their radiance is looked at first, to leave out lamps that are not bright."""
FIRST_RAYS, MAX_RAYS = 1 << 15, 1 << 20
"""Rays that are followed from lamps: at first, and at most until the light is known."""
KNOWN_TO = 0.02
"""Share of a film's light to which what matters is to be known, with a confidence of 95 %."""
MIN_DISC_SHARE = 0.1
"""Smallest radius of the disc in which light is caught, as a share of the median depth. If it is larger, more
rays are caught, but images at cameras that stand close together are separated less well."""
MIN_DISC_MM = 1.0
"""Smallest radius of the disc if no surface has a depth."""
LIT_POINTS = 1 << 13
"""Rays of each lamp that stands at a point, by which the places are known that it lights."""
SAME_DEPTH = 1e-3
"""Share by which depths of the same place may differ."""
STRAIGHT_POINTS = 1 << 13
"""Points of what shines in view, by which its light and its share of the film are known."""


class BrightLight(NamedTuple):
    """Light of one `radiance`: `what` holds it, and what it adds to the sum of radiance over a film's pixels.

    `arrivals` are where it was seen to come from, if mirrors or glass alone send it to the cameras: as many
    `bounces` of them.
    """

    what: str
    light: float
    radiance: float
    arrivals: Arrivals | None = None
    bounces: int = 0

    @classmethod
    def of(cls, what: str, light: np.ndarray, radiance: np.ndarray) -> "BrightLight":
        """All of these (N,) together, of the mean radiance of their light."""
        total = float(light.sum())
        return cls(what, total, float((light * radiance).sum()) / total)

    @property
    def image_px(self) -> float:
        """How much of a film it fills."""
        return self.light / self.radiance

    @property
    def log(self) -> dict[str, Any]:
        """What the manifest says of it."""
        light, image_px = (float(f"{value:.3g}") for value in (self.light, self.image_px))
        return {"what": self.what, "light_of_a_film": light, "image_px": image_px}

    def hits(self, paths: float, pixels: int) -> float:
        """Mean number of `paths` from the cameras, spread over films of `pixels`, that meet it."""
        return paths * self.image_px / pixels


def brightest_that_matters(film_light: float, paths: float, pixels: int) -> float:
    """Radiance up to which `paths` surely meet what matters of films whose radiance sums to `film_light`."""
    return LEAST_SHARE * film_light * paths / (SURE_HITS * pixels)


def straight_light(capture: Capture) -> list[BrightLight]:
    """What comes straight from surfaces that are drawn from: all that shines, unless a medium lies between.

    A picture has a row for each octave of its brightness, so that a bright spot counts apart from the rest.
    """
    emission = EmissionSampler(capture)
    if not emission.mass or capture.render_scene.why_rendered:
        return []
    rng = seeds.generator(EXPLORATION_SEED, stage="aimed pilot", part=2)
    _, points, radiance = emission.arriving(np.arange(STRAIGHT_POINTS) % capture.grid.view_count, rng)
    light = np.full(radiance.size, emission.mass / STRAIGHT_POINTS)
    names = [_name(capture, number) for number in emission.numbers.tolist()]
    rows = _rows(points.surface[None], radiance)
    return [BrightLight.of(names[points.surface[row[0]]], light[row], radiance[row]) for row in rows]


def mirrored_light(
    capture: Capture, film_light: float, paths: float, *, with_straight: bool
) -> list[BrightLight]:
    """What mirrors and glass send to the cameras first, of lamps so bright that `paths` may not meet it.

    `film_light` is the sum of radiance over a film as it is known. With `with_straight` also what comes
    straight from lamps that `straight_light` does not know.
    """
    z_mm, render_scene = capture.coarse_z_mm, capture.render_scene
    depth_mm = float(np.median(z_mm[np.isfinite(z_mm)])) if np.isfinite(z_mm).any() else 0.0
    reach_mm = float(np.linalg.norm(capture.rig.position_mm[..., :2], axis=-1).max())
    disc_mm = max(reach_mm, MIN_DISC_SHARE * depth_mm, MIN_DISC_MM)
    tracer = LampTracer(render_scene, capture.rig, capture.cfa, disc_mm)
    known = set() if render_scene.why_rendered else {one.number for one in render_scene.shining}
    is_known = np.array([number in known for number in tracer.objects], dtype=bool)
    if not tracer.lamps or not (tracer.has_mirrors or (with_straight and not is_known.all())):
        return []
    least_radiance = brightest_that_matters(film_light, paths, capture.pixels)
    survey = np.arange(max(SURVEY_POINTS, len(tracer.lamps))) % len(tracer.lamps)
    radiance = tracer.radiance_of(survey, seeds.integer(EXPLORATION_SEED, stage="lamp rays"))
    lamps = np.unique(survey[radiance > least_radiance])
    if not lamps.size:
        return []
    is_searched = ~is_known & with_straight
    if render_scene.hides_surroundings:
        is_searched &= np.array(tracer.objects) >= 0
    arrivals, result = _arrivals(tracer, lamps, is_searched, film_light, least_radiance), []
    if arrivals.light.sum() <= LEAST_SHARE * film_light:
        return []
    kinds = np.stack([arrivals.lamp, arrivals.is_scattered, arrivals.bounces * ~arrivals.is_scattered])
    for row in _rows(kinds, arrivals.radiance):
        alike, (lamp, is_scattered, bounces) = take_rows(arrivals, row), kinds[:, row[0]].tolist()
        name = _name(capture, tracer.objects[lamp])
        if alike.bounces.any():
            clear = capture.render_scene.names.get(int(np.bincount(alike.object_id).argmax()))
            name += " through what is no object" if clear is None else f" through '{clear}'"
        light = BrightLight.of(name, alike.light, alike.radiance)
        result.append(light if is_scattered else light._replace(arrivals=alike, bounces=bounces))
    return result


def _arrivals(
    tracer: LampTracer, lamps: np.ndarray, is_searched: np.ndarray, film_light: float, least_radiance: float
) -> Arrivals:
    """Light of the numbers `lamps` that mirrors and glass send to the cameras, or that comes straight from
    lamps of which `is_searched` (all lamps,) says so: followed until it is known, or too little to matter."""
    parts, rays = list[tuple[int, Arrivals]](), 0
    while True:
        number, round_number = max(rays, FIRST_RAYS), len(parts) + 1
        seed = seeds.integer(EXPLORATION_SEED, stage="lamp rays", round_number=round_number)
        arrivals, brightest = tracer.follow(np.resize(lamps, number), seed, least_radiance)
        parts.append((number, take_rows(arrivals, (arrivals.bounces > 0) | is_searched[arrivals.lamp])))
        rays += number
        light = np.concatenate([part.light * (of * lamps.size / rays) for of, part in parts])
        # Two standard errors, and three times the brightest ray for what none has met, are an upper limit
        # with a confidence of 95 %.
        error = 2 * np.sqrt((light**2).sum()) + 3 * brightest * lamps.size * number / rays
        does_not_matter = light.sum() + error < LEAST_SHARE * film_light
        if does_not_matter or error < KNOWN_TO * (film_light + light.sum()) or rays >= MAX_RAYS:
            break
    return join_rows([part for _, part in parts])._replace(light=light)


def lit_light(
    sampler: CandidateSampler, film_light: float, paths: float
) -> tuple[list[BrightLight], Samples]:
    """Places that a lamp at a point lights, as a spot lamp its dot, so bright that `paths` may not meet them;
    and paths through these places."""
    capture = sampler.capture
    tracer = LampTracer(capture.render_scene, capture.rig, capture.cfa, 0.0)
    least_radiance = brightest_that_matters(film_light, paths, capture.pixels)
    rows, samples = list[BrightLight](), [nothing(capture.channels).exceeding]
    seed = seeds.integer(EXPLORATION_SEED, stage="lamp rays")
    for point_mm, normal, area_mm2 in tracer.find_lit_places(LIT_POINTS, seed):
        view = np.arange(area_mm2.size) % capture.grid.view_count
        k, l = np.divmod(view, capture.grid.cols)
        away_mm = point_mm - capture.rig.position_mm[k, l]
        row, col, z_mm = capture.rig.film_px(view, away_mm)
        image_px = area_mm2 * capture.rig.image_px_per_mm2(normal, away_mm, z_mm)
        here = np.flatnonzero(is_on_film(capture.grid, row + 0.5, col + 0.5) & (image_px > 0))
        if not here.size:
            continue
        points = FilmPoints(view[here], row[here] + 0.5, col[here] + 0.5)
        traced = sampler.trace(points, here.size, seeds.integer(EXPLORATION_SEED, stage="lamp rays", part=1))
        # Where the depth is another one, something stands before the place.
        radiance = np.where(
            np.isclose(traced.z_mm, z_mm[here], rtol=SAME_DEPTH), traced.light.mean(axis=1), 0
        )
        bright = radiance > least_radiance
        if bright.any():
            light = (image_px[here] * radiance)[bright]
            rows.append(BrightLight.of("a place that a lamp lights", light, radiance[bright]))
            samples.append(take_rows(traced, bright))
    return rows, join_rows(samples)


def _rows(kinds: np.ndarray, radiance: np.ndarray) -> Iterator[np.ndarray]:
    """Indices of what is of the same kinds (K, N) and of one octave of radiance (N,)."""
    octave = np.floor(np.log2(np.maximum(radiance, np.finfo(float).tiny))).astype(np.int64)
    _, row = np.unique(np.concatenate([kinds, octave[None]]), axis=1, return_inverse=True)
    return (np.flatnonzero(row.ravel() == number) for number in range(row.max(initial=-1) + 1))


def _name(capture: Capture, number: int) -> str:
    """What an object, or 0 for a lamp of the scene and -1 for what is all around, is called in messages."""
    name = capture.render_scene.names.get(number)
    if name is None:
        return "the surroundings" if number < 0 else "a lamp"
    return f"'{name}'"

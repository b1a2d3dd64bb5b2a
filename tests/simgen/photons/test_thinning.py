"""Thinned photons are exactly Poisson with the rendered rate; each test plants a fault and sees it caught."""

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lit_scenes import EVENLY_30, LAMP, ball, card, lit, mosaics, on_blocks, two_balls
from photon_statistics import counted, p_value
from scipy import stats

from pcii.base import InputError
from pcii.types import CameraGrid, colour_index
from simgen.photons import Capture, Plan, explore, plan_counts, thin_photons
from simgen.renderer import RenderScene, backend, load_drjit
from simgen.sensor import PhotonTable
from simgen.spec import Photons
from simgen.truth import first_hits_of_view

pytestmark = pytest.mark.renders
COMPILED = backend.choose().kind != "scalar"
# A photon takes 2 us with a compiled backend, 80 us without: fewer of them there, to see larger faults.
DRAWS = 25
MANY = 100_000 if COMPILED else 50_000
GRID = CameraGrid(rows=2, cols=2, pitch_mm=(20.0, 15.0), focal_mm=50.0, pixel_mm=2.0, height=32, width=32)


@pytest.fixture(scope="module")
def scene() -> RenderScene:
    return two_balls()


@pytest.fixture(scope="module")
def radiance(scene: RenderScene) -> np.ndarray:
    """Mosaics (V, H, W) from 1024 samples per pixel: good to about 2 % per pixel, 0.2 % per tile."""
    return mosaics(scene, GRID, 1024, seed=7)


explorations: dict[tuple[int, str], tuple[RenderScene, Plan]] = {}


@pytest.fixture(autouse=True, scope="module")
def scenes_are_given_up() -> Iterator[None]:
    """The renderer compiles its kernels anew where other scenes are in memory than in the last run."""
    yield
    explorations.clear()


def explored(capture: Capture) -> Plan:
    """It is the same for all seeds, and takes longer than a draw of few photons."""
    key = id(capture.render_scene), capture.photons.model_dump_json()
    if key not in explorations:
        explorations[key] = capture.render_scene, explore(capture)
    return explorations[key][1]


def draw_with_log(scene: RenderScene, seed: int, **photons: object) -> tuple[PhotonTable, dict[str, Any]]:
    capture = Capture(scene, GRID, "GRBG", Photons.model_validate(photons), seed=seed)
    return thin_photons(capture, explored(capture))


def draw(scene: RenderScene, seed: int, **photons: object) -> PhotonTable:
    return draw_with_log(scene, seed, **photons)[0]


def by_pixel(drawn: PhotonTable) -> np.ndarray:
    """Photons per pixel, (V, H, W)."""
    return counted(drawn, GRID).reshape(4, 32, 32)


def uniform_if_poisson(counts: np.ndarray, rates: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Randomised probability integral transform: independent uniforms if counts are Poisson(rates)."""
    below = stats.poisson.cdf(counts - 1, rates)
    return below + rng.random(counts.shape) * stats.poisson.pmf(counts, rates)


def on_tiles(pixels: np.ndarray) -> np.ndarray:
    """Sums over 4 x 4 pixels, (..., V, 8, 8)."""
    return on_blocks(pixels, 4)


def rates_of(radiance: np.ndarray, budget: float) -> np.ndarray:
    return budget * radiance / radiance.sum(axis=(1, 2), keepdims=True)


@pytest.fixture(scope="module")
def repeated(scene: RenderScene) -> np.ndarray:
    """Photons per pixel of independent draws of 1500 photons per view, (`DRAWS`, V, H, W)."""
    return np.stack([by_pixel(draw(scene, seed, budget=1500)) for seed in range(DRAWS)])


def test_counts_fit_the_rendered_rates_pixel_by_pixel_and_tile_by_tile(
    repeated: np.ndarray, radiance: np.ndarray
) -> None:
    rng = np.random.default_rng(1)
    rates = rates_of(radiance, 1500.0)
    tilted = rates * np.linspace(0.9, 1.1, 32)  # the fault: brightness off by up to 10 % across the film
    for counts, expected in ((repeated, rates), (on_tiles(repeated), on_tiles(rates))):
        uniform = (uniform_if_poisson(n, expected, rng).ravel() for n in counts)
        p_values = [stats.kstest(each, "uniform").pvalue for each in uniform]
        # Each draw's p-value is itself uniform; one suite in a thousand fails by chance.
        assert stats.kstest(p_values, "uniform").pvalue > 1e-3
    pooled, n = on_tiles(repeated).sum(axis=0), len(repeated)
    assert p_value(pooled, n * on_tiles(rates)) > 1e-3
    assert p_value(pooled, n * on_tiles(tilted)) < 1e-6


def test_totals_are_poisson(repeated: np.ndarray) -> None:
    totals, mean = repeated.sum(axis=(2, 3)).ravel(), np.array(1500)
    assert 1e-3 < p_value(totals, mean) < 1 - 1e-3
    assert p_value(np.full(totals.size, 1500), mean) > 1 - 1e-3  # the fault: as many each time
    assert p_value(totals + 150, mean) < 1e-3


def test_there_is_no_rendering_noise_in_the_counts(
    scene: RenderScene, repeated: np.ndarray, radiance: np.ndarray
) -> None:
    rates, drawn = on_tiles(rates_of(radiance, 1500.0)), on_tiles(repeated)

    def dispersion(counts: np.ndarray) -> float:
        return float(((counts - rates) ** 2 / rates).mean())

    # The mean of n squared standard Poisson deviates is 1 with a spread of sqrt((2 + 1 / rate) / n).
    spread = np.sqrt((2 + (1 / rates).mean()) / drawn.size)
    assert abs(dispersion(drawn) - 1) < 4 * spread
    rng = np.random.default_rng(2)
    # The fault: mosaics of one sample per pixel, whose noise makes counts a Cox process.
    one_sample = (mosaics(scene, GRID, 1, seed=8 * seed) for seed in range(20))
    noisy = np.stack([rng.poisson(rates_of(each, 1500.0)) for each in one_sample])
    assert dispersion(on_tiles(noisy)) > 1 + 8 * spread


def test_the_first_photons_of_a_scope_are_a_smaller_draw(scene: RenderScene, radiance: np.ndarray) -> None:
    drawn: Any = draw(scene, 6, budget=20_000, statistics="multinomial")
    counts = by_pixel(drawn.take(drawn.rank < 2000))
    assert counts.sum(axis=(1, 2)).tolist() == [2000] * 4
    expected = on_tiles(rates_of(radiance, 2000.0))
    chi = ((on_tiles(counts) - expected) ** 2 / expected).sum()
    assert stats.chi2.sf(chi, 4 * 63) > 1e-3


RAYS_ACROSS = 32  # through a pixel along each axis


def seen_in_pixels(scene: RenderScene, drawn: PhotonTable) -> tuple[np.ndarray, np.ndarray]:
    """Object id and planar depth (N, M) that rays evenly spread over each photon's pixel hit first."""
    across = RAYS_ACROSS * 32
    fine = replace(GRID, height=across, width=across, pixel_mm=GRID.pixel_mm / RAYS_ACROSS)
    views = [first_hits_of_view(scene, fine, k, l) for k, l in np.ndindex(2, 2)]
    cells = np.indices((RAYS_ACROSS, RAYS_ACROSS)).reshape(2, 1, -1)
    view, i, j = (index[:, None] for index in (2 * drawn.k + drawn.l, drawn.i, drawn.j))
    ray = view, RAYS_ACROSS * i + cells[0], RAYS_ACROSS * j + cells[1]
    return np.stack([hits.object_id for hits in views])[ray], np.stack([hits.z_mm for hits in views])[ray]


def test_each_photon_knows_what_it_came_from(scene: RenderScene) -> None:
    drawn: Any = draw(scene, 7, budget=1000)
    object_id, z_mm = seen_in_pixels(scene, drawn)

    def agrees(own_id: np.ndarray, own_z_mm: np.ndarray) -> np.ndarray:
        same = object_id == own_id[:, None]
        near, far = np.where(same, z_mm, np.inf).min(axis=1), np.where(same, z_mm, -np.inf).max(axis=1)
        # Rays are 0.75 mm apart at 600 mm: a ball's depth changes more only within 1 mm of its outline.
        return same.any(axis=1) & (own_z_mm > near - 20) & (own_z_mm < far + 20)

    # An object may cover less of a pixel than lies between rays.
    assert (~agrees(drawn.object_id, drawn.z_mm)).sum() <= 3
    # The fault: everyone has their neighbour's origin.
    assert (~agrees(np.roll(drawn.object_id, 1), np.roll(drawn.z_mm, 1))).sum() > 50


def test_highlights_of_glossy_things_are_as_bright_as_they_should_be() -> None:
    lamp = LAMP | {"width_mm": 20, "height_mm": 20, "luminance_cd_m2": 2e5}
    plastic, gold = ball("plastic", -130.0, 600.0, (0.8, 0.2, 0.1)), ball("gold", 150.0, 700.0, (0, 0, 0))
    plastic["material"]["finish"] = {"type": "plastic", "roughness": 0.1}
    gold["material"] = {"finish": {"type": "metal", "name": "Au", "roughness": 0.1}}
    scene = lit([plastic, gold], [lamp, EVENLY_30])
    budget = 10_000 if COMPILED else 6000
    drawn, log = draw_with_log(scene, 1, budget=budget)
    assert log["paths_above_bound"] <= 1e-2 * log["kept"]
    rates = rates_of(mosaics(scene, GRID, 1024, seed=3), budget)
    assert rates.max() > 0.1 * budget  # a tenth of the light and more is in one pixel's highlight
    counts = on_tiles(by_pixel(drawn))
    assert p_value(counts, on_tiles(rates)) > 1e-3
    dulled = np.minimum(rates, 0.7 * rates.max())  # the fault: the brightest highlights are clipped
    assert p_value(counts, on_tiles(dulled)) < 1e-3


@pytest.mark.skipif(not COMPILED, reason="scalar mode draws photons on one thread")
def test_the_number_of_threads_changes_nothing(scene: RenderScene) -> None:
    dr = load_drjit()
    threads = dr.thread_count()
    many = draw(scene, 8, budget=900)
    try:
        dr.set_thread_count(1)
        alone = draw(scene, 8, budget=900)
    finally:
        dr.set_thread_count(threads)
    for name in ("k", "l", "i", "j", "object_id", "z_mm", "scope", "rank"):
        np.testing.assert_array_equal(getattr(many, name), getattr(alone, name))


def test_fine_stripes_of_pure_colours_keep_their_colours() -> None:
    # Little more than a pixel wide: a tile holds red that has no blue, and blue that has no red.
    stripes = [
        card(600.0, 30.0, {"reflectance": colour}, f"stripe{number}", at_mm=(30.0 * number - 225.0, 0.0))
        for number, colour in enumerate(8 * [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0)])
    ]
    for stripe in stripes:
        stripe["shape"]["height_mm"] = 400.0
    scene = lit(stripes)
    counts = by_pixel(draw(scene, 1, budget=30_000))
    # Stripes' edges vary most within pixels: with fewer samples the rates' own noise would show.
    rates = rates_of(mosaics(scene, GRID, 1024, seed=7), 30_000.0)
    colours = colour_index(32, 32, "GRBG")
    for colour in range(3):
        found, expected = (pixels[:, colours == colour].ravel() for pixels in (counts, rates))
        assert found[expected == 0].sum() == 0
        found, expected = found[expected > 1], expected[expected > 1]  # chi-square wants a photon or two
        assert p_value(found, expected) > 1e-3, "RGB"[colour]
        # The fault: where a colour is dark beside another it gets too little.
        missing = np.where(expected < np.median(expected), 0.8 if COMPILED else 0.6, 1.0) * expected
        assert p_value(found, missing) < 1e-3


def too_low(explored: Plan, factor: float) -> Plan:
    """The same with bounds that most paths exceed."""
    assert explored.majorant is not None
    majorant = deepcopy(explored.majorant)
    majorant.scale(factor)
    return replace(explored, majorant=majorant)


@pytest.mark.parametrize("light", [{"budget": MANY / 20}, {"scope": "exposure"}])
def test_what_exceeds_the_bounds_is_drawn_after_all(
    scene: RenderScene, radiance: np.ndarray, light: dict, monkeypatch: pytest.MonkeyPatch
) -> None:
    gain = None if "budget" in light else MANY / 5 / radiance.sum()
    capture = Capture(scene, GRID, "GRBG", Photons.model_validate(light), gain, seed=5)
    known, reported = too_low(explore(capture), 0.2), list[tuple[str, int, int]]()

    def chi_square() -> float:
        drawn, log = thin_photons(capture, known, lambda *stage: reported.append(stage))
        assert log["paths_above_bound"] > 100
        expected = on_tiles(rates_of(radiance, MANY / 20) if gain is None else gain * radiance)
        found = on_tiles(by_pixel(drawn))
        seen = expected > 5
        # The reference is good to 0.2 % of a tile.
        variance = expected + (0.002 * expected) ** 2
        return float(stats.chi2.sf(((found - expected)[seen] ** 2 / variance[seen]).sum(), seen.sum()))

    assert chi_square() > 1e-3
    for stage in {name for name, _, _ in reported}:
        done = [count for name, count, _ in reported if name == stage]
        assert done == sorted(done)
    # The fault: paths that exceed their bound give one photon, and nothing is drawn of what lies above.
    monkeypatch.setattr("simgen.photons.thinning._Drawing._draw_above", lambda *_: None)
    thin = thin_photons(capture, known)[0]
    assert p_value(on_tiles(by_pixel(thin)), on_tiles(rates_of(radiance, float(thin.k.size) / 4))) < 1e-6


def test_light_that_exceeds_every_bound_is_refused(
    scene: RenderScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("simgen.photons.thinning.MAX_RAISES", 1)
    monkeypatch.setattr("simgen.photons.majorant.RAISE_FACTOR", 0.3)  # never above what exceeded
    capture = Capture(scene, GRID, "GRBG", Photons(budget=2000), seed=1)
    known = too_low(explore(capture), 0.05)
    with pytest.raises(InputError, match=r"^photons: some light paths are so much brighter"):
        thin_photons(capture, known)


def test_a_mirror_that_throws_light_on_a_wall_has_no_bound_and_a_matt_ball_has() -> None:
    lamp = LAMP | {"position_mm": (-250, -350, 150), "target_mm": (0, 0, 580), "luminance_cd_m2": 2e4}
    lamp |= {"width_mm": 60, "height_mm": 60}
    wall = card(800.0, 4000.0, {"reflectance": (0.5, 0.5, 0.5)}, "wall")
    metal: dict[str, Any] = {"finish": {"type": "metal", "name": "Al", "roughness": 0.05}}
    matt: dict[str, Any] = {"reflectance": (0.7, 0.3, 0.2)}
    grid = replace(GRID, height=256, width=256, pixel_mm=0.25)
    for material, is_bounded in ((metal, False), (matt, True)):
        scene = lit([wall, ball("ball", 40.0, 590.0, **material)], [lamp])
        capture = Capture(scene, grid, "GRBG", Photons(budget=3000), seed=1)
        made = plan_counts(capture, backend.choose().kind)
        assert (made.thins, bool(made.why_rendered)) == (is_bounded, not is_bounded)
        assert made.noise <= 0.01

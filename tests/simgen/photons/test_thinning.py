"""Thinned photons are exactly Poisson with the rendered rate; each test plants a fault and sees it caught."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lit_scenes import EVENLY, LAMP, ball, lit, two_balls
from scipy import stats

from pcii.base import InputError
from pcii.types import CameraGrid, colour_index, mosaic
from simgen.photons import Capture, Plan, explore, plan_counts, thin_photons
from simgen.renderer import RenderScene, backend, load_drjit, render_view
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
    views = [
        render_view(scene, GRID, k, l, samples_per_pixel=1024, seed=7 + 2 * k + l)
        for k, l in np.ndindex(2, 2)
    ]
    return mosaic(np.stack(views).astype(np.float64), "GRBG")


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


def counted(drawn: PhotonTable) -> np.ndarray:
    """Photons per pixel, (V, H, W)."""
    counts = np.zeros((4, 32, 32), dtype=np.int64)
    np.add.at(counts, (2 * drawn.k + drawn.l, drawn.i, drawn.j), 1)
    return counts


def uniform_if_poisson(counts: np.ndarray, rates: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Randomised probability integral transform: independent uniforms if counts are Poisson(rates)."""
    below = stats.poisson.cdf(counts - 1, rates)
    return below + rng.random(counts.shape) * stats.poisson.pmf(counts, rates)


def on_tiles(pixels: np.ndarray) -> np.ndarray:
    """Sums over 4 x 4 pixels, (V, 8, 8)."""
    return pixels.reshape(-1, 8, 4, 8, 4).sum(axis=(2, 4))


def tiles(repeated: np.ndarray) -> np.ndarray:
    """Sums over 4 x 4 pixels of each draw, (N, V, 8, 8)."""
    return np.stack([on_tiles(counts) for counts in repeated])


def rates_of(radiance: np.ndarray, budget: float) -> np.ndarray:
    return budget * radiance / radiance.sum(axis=(1, 2), keepdims=True)


@pytest.fixture(scope="module")
def repeated(scene: RenderScene) -> np.ndarray:
    """Photons per pixel of independent draws of 1500 photons per view, (`DRAWS`, V, H, W)."""
    return np.stack([counted(draw(scene, seed, budget=1500)) for seed in range(DRAWS)])


def test_counts_fit_the_rendered_rates_pixel_by_pixel_and_tile_by_tile(
    repeated: np.ndarray, radiance: np.ndarray
) -> None:
    rng = np.random.default_rng(1)
    rates = rates_of(radiance, 1500.0)
    tilted = rates * np.linspace(0.9, 1.1, 32)  # the fault: brightness off by up to 10 % across the film
    for counts, expected in ((repeated, rates), (tiles(repeated), on_tiles(rates))):
        p_values = [
            stats.kstest(uniform_if_poisson(n, expected, rng).ravel(), "uniform").pvalue for n in counts
        ]
        # Each draw's p-value is itself uniform; one suite in a thousand fails by chance.
        assert stats.kstest(p_values, "uniform").pvalue > 1e-3
    pooled, n = tiles(repeated).sum(axis=0), len(repeated)

    def chi_square(expected: np.ndarray) -> float:
        return float(((pooled - n * on_tiles(expected)) ** 2 / (n * on_tiles(expected))).sum())

    assert stats.chi2.sf(chi_square(rates), pooled.size) > 1e-3
    assert stats.chi2.sf(chi_square(tilted), pooled.size) < 1e-6


def test_totals_are_poisson(repeated: np.ndarray) -> None:
    def dispersion(totals: np.ndarray) -> float:
        return float(stats.chi2.sf(((totals - 1500) ** 2 / 1500).sum(), totals.size))

    totals = repeated.sum(axis=(2, 3)).ravel()
    assert 1e-3 < dispersion(totals) < 1 - 1e-3
    assert dispersion(np.full(totals.size, 1500)) > 1 - 1e-3  # the fault: as many each time
    assert dispersion(totals + 150) < 1e-3


def test_there_is_no_rendering_noise_in_the_counts(
    scene: RenderScene, repeated: np.ndarray, radiance: np.ndarray
) -> None:
    rates, drawn = on_tiles(rates_of(radiance, 1500.0)), tiles(repeated)

    def dispersion(counts: np.ndarray) -> float:
        return float(((counts - rates) ** 2 / rates).mean())

    # The mean of n squared standard Poisson deviates is 1 with a spread of sqrt((2 + 1 / rate) / n).
    spread = np.sqrt((2 + (1 / rates).mean()) / drawn.size)
    assert abs(dispersion(drawn) - 1) < 4 * spread
    rng = np.random.default_rng(2)
    noisy = np.stack([rng.poisson(rates_of(one_sample(scene, seed), 1500.0)) for seed in range(20)])
    assert dispersion(tiles(noisy)) > 1 + 8 * spread


def one_sample(scene: RenderScene, seed: int) -> np.ndarray:
    """The fault: mosaics of one sample per pixel, whose noise makes counts a Cox process."""
    views = [
        render_view(scene, GRID, k, l, samples_per_pixel=1, seed=8 * seed + 2 * k + l)
        for k, l in np.ndindex(2, 2)
    ]
    return mosaic(np.stack(views).astype(np.float64), "GRBG")


colour_of_pixel = colour_index(32, 32, "GRBG")


def test_the_first_photons_of_a_scope_are_a_smaller_draw(scene: RenderScene, radiance: np.ndarray) -> None:
    drawn = draw(scene, 6, budget=20_000, statistics="multinomial")
    assert drawn.rank is not None
    first = drawn.rank < 2000
    counts = np.zeros((4, 32, 32))
    np.add.at(counts, (2 * drawn.k[first] + drawn.l[first], drawn.i[first], drawn.j[first]), 1)
    assert counts.sum(axis=(1, 2)).tolist() == [2000] * 4
    expected = on_tiles(rates_of(radiance, 2000.0))
    chi = ((on_tiles(counts) - expected) ** 2 / expected).sum()
    assert stats.chi2.sf(chi, 4 * 63) > 1e-3


RAYS_ACROSS = 32
"""Rays through a pixel along each axis."""


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
    drawn = draw(scene, 7, budget=1000)
    assert drawn.object_id is not None
    assert drawn.z_mm is not None
    object_id, z_mm = seen_in_pixels(scene, drawn)

    def agrees(own_id: np.ndarray, own_z_mm: np.ndarray) -> np.ndarray:
        same = object_id == own_id[:, None]
        near, far = (
            pick(np.where(same, z_mm, beyond), axis=1)
            for pick, beyond in ((np.min, np.inf), (np.max, -np.inf))
        )
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
    scene = lit([plastic, gold], [lamp, EVENLY])
    budget = 10_000 if COMPILED else 6000
    drawn, log = draw_with_log(scene, 1, budget=budget)
    assert log["paths_above_bound"] <= 1e-2 * log["kept"]
    views = [
        render_view(scene, GRID, k, l, samples_per_pixel=1024, seed=3 + 2 * k + l)
        for k, l in np.ndindex(2, 2)
    ]
    rates = rates_of(mosaic(np.stack(views).astype(np.float64), "GRBG"), budget)
    assert rates.max() > 0.1 * budget  # a tenth of the light and more is in one pixel's highlight
    counts = on_tiles(counted(drawn))

    def chi_square(expected: np.ndarray) -> float:
        return float(((counts - expected) ** 2 / expected).sum())

    assert stats.chi2.sf(chi_square(on_tiles(rates)), counts.size) > 1e-3
    dulled = np.minimum(rates, 0.7 * rates.max())  # the fault: the brightest highlights are clipped
    assert stats.chi2.sf(chi_square(on_tiles(dulled)), counts.size) < 1e-3


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
        {
            "name": f"stripe{number}",
            "position_mm": (30.0 * number - 225.0, 0.0, 600.0),
            "shape": {"type": "card", "width_mm": 30.0, "height_mm": 400.0},
            "material": {"reflectance": (1.0, 0.0, 0.0) if number % 2 else (0.0, 0.0, 1.0)},
        }
        for number in range(16)
    ]
    scene = lit(stripes)
    counts = counted(draw(scene, 1, budget=30_000))
    # Stripes' edges vary most within pixels: with fewer samples the rates' own noise would show.
    views = [
        render_view(scene, GRID, k, l, samples_per_pixel=1024, seed=7 + 2 * k + l)
        for k, l in np.ndindex(2, 2)
    ]
    expected = rates_of(mosaic(np.stack(views).astype(np.float64), "GRBG"), 30_000.0)
    for colour in range(3):
        found, own = (
            counts[:, colour_of_pixel == colour].ravel(),
            expected[:, colour_of_pixel == colour].ravel(),
        )
        assert found[own == 0].sum() == 0
        found, own = found[own > 1], own[own > 1]  # chi-square wants a photon or two
        assert stats.chi2.sf(((found - own) ** 2 / own).sum(), own.size) > 1e-3, "RGB"[colour]
        # The fault: where a colour is dark beside another it gets too little.
        missing = np.where(own < np.median(own), 0.8 if COMPILED else 0.6, 1.0) * own
        assert stats.chi2.sf(((found - missing) ** 2 / missing).sum(), own.size) < 1e-3


def too_low(explored: Plan, factor: float) -> Plan:
    """The same with bounds that most paths exceed."""
    assert explored.majorant is not None
    majorant = explored.majorant.copy()
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
        found = on_tiles(counted(drawn))
        seen = expected > 5
        # The reference is good to 0.2 % of a tile.
        return float(
            stats.chi2.sf(
                ((found - expected)[seen] ** 2 / (expected + (0.002 * expected) ** 2)[seen]).sum(), seen.sum()
            )
        )

    assert chi_square() > 1e-3
    for stage in {name for name, _, _ in reported}:
        done = [count for name, count, _ in reported if name == stage]
        assert done == sorted(done)
    # The fault: paths that exceed their bound give one photon, and nothing is drawn of what lies above.
    monkeypatch.setattr("simgen.photons.thinning._Drawing._draw_above", lambda *_: None)
    thin = thin_photons(capture, known)[0]
    expected = on_tiles(rates_of(radiance, float(thin.k.size) / 4))
    assert stats.chi2.sf(((on_tiles(counted(thin)) - expected) ** 2 / expected).sum(), expected.size) < 1e-6


def test_light_that_exceeds_every_bound_is_refused(
    scene: RenderScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("simgen.photons.thinning.MAX_RAISES", 1)
    monkeypatch.setattr("simgen.photons.majorant.RAISE_FACTOR", 0.3)  # never above what exceeded
    capture = Capture(scene, GRID, "GRBG", Photons(budget=2000), seed=1)
    known = too_low(explore(capture), 0.05)
    with pytest.raises(InputError, match=r"^photons: some light paths are so much brighter"):
        thin_photons(capture, known)


WALL = {
    "name": "wall",
    "position_mm": (0.0, 0.0, 800.0),
    "shape": {"type": "card", "width_mm": 4000.0, "height_mm": 4000.0},
    "material": {"reflectance": (0.5, 0.5, 0.5)},
}


def test_a_mirror_that_throws_light_on_a_wall_has_no_bound_and_a_matt_ball_has() -> None:
    lamp = {
        "type": "area",
        "position_mm": (-250, -350, 150),
        "target_mm": (0, 0, 580),
        "luminance_cd_m2": 2e4,
    }
    lamp |= {"width_mm": 60, "height_mm": 60}
    metal = {"finish": {"type": "metal", "name": "Al", "roughness": 0.05}}
    grid = replace(GRID, height=256, width=256, pixel_mm=0.25)
    for material, is_bounded in ((metal, False), ({"reflectance": (0.7, 0.3, 0.2)}, True)):
        thing = ball("ball", 40.0, 590.0, (1, 1, 1)) | {"material": material}
        capture = Capture(lit([WALL, thing], [lamp]), grid, "GRBG", Photons(budget=3000), seed=1)
        made = plan_counts(capture, backend.choose().kind)
        assert (made.thins, bool(made.why_rendered)) == (is_bounded, not is_bounded)
        assert made.noise <= 0.01

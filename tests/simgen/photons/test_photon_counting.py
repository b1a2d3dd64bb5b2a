"""Counts of a dataset: which way they are made, with how much noise, budgets within budgets, and files."""

from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import zarr
from lit_scenes import EVENLY, LAMP, build_scene, two_balls
from photon_statistics import counted, has_mean, is_poisson, p_value

from pcii.base import InputError, silent
from pcii.store import COUNTS, PHOTON_TRUTH, nested_name
from pcii.types import CameraGrid, PhotonCounts, colour_index, sense
from simgen.dataset import capture_of, draw_from_views, write_counts
from simgen.photons import Capture, Plan, plan_counts, probe, thin_photons
from simgen.renderer import RenderScene, backend, build, render_view
from simgen.sensor import PhotonTable, nested_subset
from simgen.spec import Recipe, load_scene

PLAN = Plan(thins=True, samples=1, photons_per_view=0.0, noise=0.0, normaliser_error=0.0)
MAX_NOISE_SHARE, MAX_NORMALISER_ERROR, MAX_SINGLE_PHOTONS = 0.01, 0.003, 1 << 25
BUDGETS = (120, 40, 8)
HEIGHT, WIDTH = 8, 10


def recipe(rows: int = 2, cols: int = 2, **changes: object) -> Recipe:
    """Few pixels whose films are as large as the scene."""
    grid = {"rows": rows, "cols": cols, "height": HEIGHT, "width": WIDTH, "pixel_mm": 4.0}
    values = {"scene": "two_objects", "seed": 1, "grid": grid, "photons": nested()}
    return Recipe.model_validate(values | changes)


def nested(**photons: object) -> dict:
    return {"budget": BUDGETS[0], "nested": [8, 40], **photons}


def mosaic_of(k: int, l: int) -> np.ndarray:
    """A made-up view: bright and dim pixels, a dark one, each view brighter than the one before."""
    return (1 + 2 * k + l) * ((7 * np.arange(HEIGHT * WIDTH)) % 23.0).reshape(HEIGHT, WIDTH)


def planned(made: Recipe, render_scene: RenderScene, kind: str) -> Plan:
    capture = capture_of(made, render_scene, made.seed)
    return plan_counts(capture, kind, may_explore=lambda _: False)


def thin(made: Recipe, render_scene: RenderScene, plan: Plan = PLAN) -> PhotonTable:
    return thin_photons(capture_of(made, render_scene, made.seed), plan)[0]


def without_scene(made: Recipe) -> Capture:
    """For counts that are drawn from made-up views."""
    return capture_of(made, cast(Any, None), made.seed)


def dense(made: Recipe) -> PhotonTable:
    return draw_from_views(without_scene(made), lambda k, l: (mosaic_of(k, l), np.zeros(3)), PLAN, silent)[0]


@pytest.fixture(scope="module")
def two_objects() -> RenderScene:
    found = load_scene("two_objects")
    return build(backend.load(), found, found.folder or Path(), 3)


def by_pixel(counts: PhotonTable, recipe: Recipe) -> np.ndarray:
    """Counts per pixel, (V, H, W)."""
    return counted(counts, recipe.grid.camera_grid()).reshape(-1, HEIGHT, WIDTH)


def subset(arrivals: PhotonTable, made: Recipe, budget: float) -> PhotonTable:
    if budget == made.photons.budget:
        return arrivals
    return arrivals.take(nested_subset(arrivals, arrivals, made.photons, budget, made.seed))


def by_scope(views: np.ndarray, scope: str) -> np.ndarray:
    """Totals of every view, of each colour of every view, or of all."""
    if scope == "view":
        return views.sum(axis=(1, 2))
    if scope == "scene":
        return views.sum()[None]
    colours = colour_index(HEIGHT, WIDTH, "GRBG")
    return np.concatenate([views[:, colours == colour].sum(axis=1) for colour in range(3)])


@pytest.mark.parametrize(("scope", "draws"), [("view", 150), ("channel", 50), ("scene", 600)])
def test_totals_of_nested_budgets_are_poisson(scope: str, draws: int) -> None:
    totals: dict[int, list[np.ndarray]] = {budget: [] for budget in BUDGETS}
    for seed in range(draws):
        made = recipe(seed=seed, photons=nested(scope=scope))
        arrivals = dense(made)
        for budget, drawn in totals.items():
            drawn.append(by_scope(by_pixel(subset(arrivals, made, budget), made), scope))
    found = {budget: np.concatenate(drawn) for budget, drawn in totals.items()}
    assert found[120].size >= 600
    for budget in BUDGETS:
        assert is_poisson(found[budget], budget)
        assert not is_poisson(2 * found[budget], budget)
    for budget, larger in ((40, 120), (8, 40)):  # the faults: no chance in how many, or as many each time
        assert not is_poisson(np.rint(found[larger] * budget / larger), budget)
        assert not is_poisson(np.full(found[larger].size, budget), budget)


@pytest.mark.renders
@pytest.mark.parametrize("scope", ["view", "channel", "scene"])
@pytest.mark.parametrize("thins", [True, False])
def test_multinomial_totals_of_nested_budgets_are_exact(
    two_objects: RenderScene, scope: str, thins: bool
) -> None:
    made = recipe(photons=nested(scope=scope, statistics="multinomial"))
    arrivals = thin(made, two_objects) if thins else dense(made)
    for budget in BUDGETS:
        totals = by_scope(by_pixel(subset(arrivals, made, budget), made), scope)
        assert totals.tolist() == [budget] * {"view": 4, "channel": 12, "scene": 1}[scope]


@pytest.mark.parametrize("statistics", ["poisson", "multinomial"])
def test_each_budget_is_a_subset_of_the_next(statistics: str) -> None:
    made = recipe(photons=nested(statistics=statistics))
    arrivals = dense(made)
    belongs = [nested_subset(arrivals, arrivals, made.photons, budget, made.seed) for budget in (8, 40)]
    assert 0 < belongs[0].sum() < belongs[1].sum() < belongs[1].size
    assert (belongs[0] <= belongs[1]).all()
    larger = by_pixel(arrivals.take(belongs[1]), made)
    # Budgets that are nearly the same: 100 times the smaller one might get more than the larger.
    near = recipe(10, 10, photons={"budget": 120, "nested": [38, 40], "statistics": statistics})
    many = dense(near)
    less, more = (nested_subset(many, many, near.photons, budget, near.seed) for budget in (38, 40))
    assert (less <= more).all()
    independent = by_pixel(subset(dense(recipe(seed=2)), made, 8), made)
    assert (independent > larger).any()  # the fault: a smaller budget that was drawn by itself


def test_photons_of_a_smaller_budget_are_spread_like_the_light() -> None:
    views = np.stack([mosaic_of(k, l) for k, l in np.ndindex(2, 2)])
    expected, draws = 8 * views / views.sum(axis=(1, 2), keepdims=True), 150
    found, first_rows = np.zeros(views.shape), np.zeros(views.shape)
    for seed in range(draws):
        made = recipe(seed=seed)
        arrivals: Any = dense(made)
        found += by_pixel(subset(arrivals, made, 8), made)
        in_order = np.arange(arrivals.k.size)
        start = np.searchsorted(arrivals.scope, np.arange(4))
        first_rows += by_pixel(arrivals.take(in_order - start[arrivals.scope] < 8), made)
    lit = expected > 0
    assert (found[~lit] == 0).all()
    assert p_value(found[lit], draws * expected[lit]) > 1e-3
    # The fault: a scope's first photons by their place on the film, not by chance.
    assert p_value(first_rows[lit], draws * expected[lit]) < 1e-6


def test_views_without_light_have_no_photons_of_any_budget() -> None:
    made = recipe(photons=nested(statistics="multinomial"))
    capture = without_scene(made)
    arrivals, log = draw_from_views(capture, lambda k, l: (k * mosaic_of(k, l), np.zeros(3)), PLAN, silent)
    assert log["views_without_light"] == 2
    for budget in BUDGETS:
        totals = by_scope(by_pixel(subset(arrivals, made, budget), made), "view")
        assert totals.tolist() == [0, 0, budget, budget]


def stored(out: Path, made: Recipe, budget: float | None = None) -> np.ndarray:
    """The counts in a folder, (V, H, W)."""
    group = zarr.open_group(out / nested_name(COUNTS, budget), mode="r")
    columns = {name: np.asarray(group[name]) for name in "klijn"}
    counts = PhotonCounts.from_events(*columns.values(), grid=made.grid.camera_grid(), cfa=made.cfa)
    return np.stack([counts.view(k, l) for k, l in np.ndindex(made.grid.rows, made.grid.cols)])


FAULTY = {"quantum_efficiency": (0.8, 0.9, 0.7), "dark_counts": 0.05, "dead_pixel_share": 0.05}
FAULTY |= {"hot_pixel_share": 0.05, "hot_pixel_counts": 4.0}
IN_FRAMES = FAULTY | {"bits": 1, "frames": 3}


@pytest.mark.parametrize("sensor", [{}, FAULTY | {"bits": 2}, IN_FRAMES])
def test_what_is_written_is_nested_whatever_the_sensor(sensor: dict, tmp_path: Path) -> None:
    made = recipe(sensor=sensor)
    log = write_counts(without_scene(made), made.sensor, dense(made), tmp_path, with_origins=True)
    whole, middle, small = (stored(tmp_path, made, budget) for budget in (None, 40, 8))
    assert (small <= middle).all()
    assert (middle <= whole).all()
    assert small.sum() < middle.sum() < whole.sum()
    assert log["total"] == whole.sum()
    assert log["pixels_with_photons"] == (whole > 0).sum()
    for row, budget, part in zip(log["nested"], (8, 40), (small, middle), strict=True):
        assert row == {"budget": budget, "total": part.sum(), "pixels_with_photons": (part > 0).sum()}
    assert not (tmp_path / PHOTON_TRUTH).exists()  # rendered views do not know what a photon came from


def test_dark_counts_are_in_every_budget(tmp_path: Path) -> None:
    lost = recipe(sensor={"quantum_efficiency": (1e-9,) * 3, "dark_counts": 0.5})
    write_counts(without_scene(lost), lost.sensor, dense(lost), tmp_path, with_origins=True)
    whole, small = stored(tmp_path, lost), stored(tmp_path, lost, 8)
    np.testing.assert_array_equal(whole, small)
    assert has_mean(whole, 0.5)


def from_known_places(made: Recipe) -> PhotonTable:
    """Photons in random order; each of an object and from a depth that tell its pixel."""
    rng = np.random.default_rng(1)
    shape = made.grid.camera_grid().shape_KLHW
    flat = rng.integers(0, np.prod(shape), 900)
    ones = np.ones(flat.size, dtype=np.int64)
    k, l, i, j = np.unravel_index(flat, shape)
    return PhotonTable(k, l, i, j, ones, 0 * ones, np.arange(flat.size), flat + 1, flat + 0.5)


@pytest.mark.parametrize(
    "sensor", [{}, FAULTY | {"hot_pixel_counts": 20.0, "bits": 2}, IN_FRAMES | {"frames": 40}]
)
@pytest.mark.parametrize("budget", [None, 40])
def test_each_written_photon_has_its_own_origin(budget: float | None, sensor: dict, tmp_path: Path) -> None:
    made = recipe(sensor=sensor, photons=nested(scope="scene"))
    write_counts(without_scene(made), made.sensor, from_known_places(made), tmp_path, with_origins=True)
    origins = zarr.open_group(tmp_path / nested_name(PHOTON_TRUTH, budget), mode="r")
    object_id, z_mm = np.asarray(origins["object_id"]), np.asarray(origins["z_mm"])
    counts = stored(tmp_path, made, budget).ravel()
    pixel = np.arange(counts.size).repeat(counts)
    assert object_id.shape == z_mm.shape == pixel.shape
    real = object_id != -1
    np.testing.assert_array_equal(object_id[real], pixel[real] + 1)
    np.testing.assert_array_equal(z_mm[real], pixel[real] + 0.5)
    assert np.isinf(z_mm[~real]).all()
    assert (~real).any() == bool(sensor)
    assert (np.roll(object_id, 1)[real] != pixel[real] + 1).any()  # the fault: one's neighbour's origin


def test_frames_are_written_on_request_and_nested_like_the_photons(tmp_path: Path) -> None:
    made = recipe(sensor=IN_FRAMES | {"frames": 40}, photons=nested(scope="scene"))
    capture, arrivals = without_scene(made), from_known_places(made)
    write_counts(capture, made.sensor, arrivals, tmp_path, with_origins=True, keeps_frames=True)
    bits: dict[float | None, set[tuple[int, ...]]] = {}
    for budget in (None, 40, 8):
        group = zarr.open_group(tmp_path / nested_name(COUNTS, budget), mode="r")
        n, frame = np.asarray(group["n"]), np.asarray(group["frame"])
        assert frame.dtype == np.uint16
        pixels = (np.asarray(group[name]).repeat(n).tolist() for name in "klij")
        bits[budget] = set(zip(*pixels, frame.tolist(), strict=True))
        assert len(bits[budget]) == frame.size == n.sum()  # each pixel and frame once
    assert bits[8] < bits[40] < bits[None]
    without = tmp_path / "without"
    without.mkdir()
    write_counts(capture, made.sensor, arrivals, without, with_origins=True)
    assert "frame" not in zarr.open_group(without / COUNTS, mode="r")


PROBED = {"rows": 2, "cols": 3, "height": 64, "width": 64, "pixel_mm": 0.5}


@pytest.fixture(scope="module")
def wall() -> RenderScene:
    """Evenly lit, but for the noise of paths that a lamp's area and a second surface bring."""
    lamp = LAMP | {"position_mm": (300, 0, 100), "target_mm": (0, 0, 500), "luminance_cd_m2": 100.0}
    lamp |= {"width_mm": 300.0, "height_mm": 300.0}
    return build_scene([], [lamp], max_depth=3, backdrop={"z_mm": 500.0, "reflectance": (0.8, 0.8, 0.8)})


@pytest.mark.renders
def test_what_is_made_in_either_way_is_exact_at_every_budget(
    two_objects: RenderScene, wall: RenderScene
) -> None:
    ways = set()
    for scene, kind in ((two_objects, "llvm"), (two_objects, "scalar"), (wall, "llvm")):
        for budget in (10, 1e3, 1e7, 1e9):
            plan = planned(recipe(grid=PROBED, photons={"budget": budget}), scene, kind)
            assert plan.thins or (plan.noise <= MAX_NOISE_SHARE and budget > 10)
            assert plan.normaliser_error <= MAX_NORMALISER_ERROR
            assert plan.keeps_origins == (6 * budget <= MAX_SINGLE_PHOTONS)
            ways.add((plan.thins, plan.keeps_origins))
    assert len(ways) == 4


@pytest.mark.renders
def test_more_photons_than_can_be_exact_are_refused_with_how_many_can(two_objects: RenderScene) -> None:
    with pytest.raises(InputError, match="more than can be made without rendering noise; at most") as refused:
        planned(recipe(grid=PROBED, photons={"budget": 1e13}), two_objects, "llvm")
    most = float(str(refused.value).split()[-3])
    assert planned(recipe(grid=PROBED, photons={"budget": most}), two_objects, "llvm").thins


@pytest.mark.renders
def test_photons_that_are_too_many_to_be_kept_are_the_same_but_for_their_origins(
    two_objects: RenderScene,
) -> None:
    made = recipe(photons={"budget": 500})
    kept, summed = thin(made, two_objects), thin(made, two_objects, replace(PLAN, keeps_origins=False))
    assert kept.object_id is not None
    assert summed.object_id is None
    assert summed.k.size < kept.k.size == summed.n.sum()
    np.testing.assert_array_equal(by_pixel(summed, made), by_pixel(kept, made))


@pytest.mark.renders
@pytest.mark.parametrize(
    "scope", [{"photons": {"budget": 3e4}}, {"photons": {"scope": "exposure"}, "exposure": {}}]
)
def test_all_seeds_of_a_recipe_are_made_alike(two_objects: RenderScene, scope: dict[str, Any]) -> None:
    # Not only near break-even: the samples of dense views are the same too.
    plans = [planned(recipe(grid=PROBED, seed=seed, **scope), two_objects, "llvm") for seed in (1, 2)]
    assert plans[0] == plans[1]


@pytest.mark.renders
def test_darkness_is_planned_too() -> None:
    dark = build_scene([], [EVENLY], max_depth=3, backdrop={"z_mm": 500.0})
    for kind in ("llvm", "scalar"):
        plan = planned(recipe(grid=PROBED, photons={"budget": 1000}), dark, kind)
        assert (plan.thins, plan.samples, plan.noise, plan.normaliser_error) == (False, 1, 0, 0)
        exposed = recipe(grid=PROBED, photons={"scope": "exposure"}, exposure={})
        assert not planned(exposed, dark, kind).thins
    # What the virtual centre sees says nothing about how large a budget is.
    with pytest.raises(InputError, match=r"photons\.nested: 6e\+12 photons are too many"):
        planned(recipe(grid=PROBED, photons=nested(budget=1e12)), dark, "llvm")


GRID = CameraGrid(rows=1, cols=1, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=1.0, height=64, width=64)
DRAWS = 30
PROBE_SAMPLES = 64


@pytest.fixture(scope="module")
def scene() -> RenderScene:
    return two_balls()


def seen(built: RenderScene, samples: int, seed: int) -> np.ndarray:
    image = render_view(built, GRID, 0, 0, samples_per_pixel=samples, seed=seed)
    return sense(image, "GRBG").astype(np.float64)


@pytest.fixture(scope="module")
def radiance(scene: RenderScene) -> np.ndarray:
    """Mosaic (H, W) of 1024 samples: its own noise is one thousandth of what is measured against it."""
    return seen(scene, 1024, seed=99)


@pytest.mark.renders
def test_the_probe_sees_the_mean_and_repeats_itself(scene: RenderScene, radiance: np.ndarray) -> None:
    looked = probe(Capture(scene, GRID, "GRBG"), seed=1)
    spread = np.sqrt(looked.variance / (2 * PROBE_SAMPLES * radiance.size))
    assert abs(looked.mean - radiance.mean()) < 4 * spread
    assert probe(Capture(scene, GRID, "GRBG"), seed=1) == looked
    assert probe(Capture(scene, GRID, "GRBG"), seed=2) != looked


def looked_often(built: RenderScene, grid: CameraGrid) -> Any:
    """The mean of four probes: few paths find much light, and one probe's variance is good to 16 %."""
    found = [probe(Capture(built, grid, "GRBG"), seed) for seed in range(4)]
    mean, variance = (float(np.mean(values)) for values in zip(*(one[:2] for one in found), strict=True))
    return found[0]._replace(mean=mean, variance=variance)


def excess(scene: RenderScene, radiance: np.ndarray, gain: float, samples: int) -> float:
    """By how much counts drawn from noisy views are more dispersed than Poisson ones, as a share of that."""
    rng = np.random.default_rng(1)
    rates = gain * radiance
    drawn = [rng.poisson(gain * seen(scene, samples, seed)) for seed in range(DRAWS)]
    return float(((np.array(drawn) - rates) ** 2).sum() / rates.sum() / DRAWS - 1)


@pytest.mark.renders
def test_counts_are_as_noisy_as_the_probe_tells(scene: RenderScene, radiance: np.ndarray) -> None:
    looked = looked_often(scene, GRID)
    close = 1.4  # 4 standard errors: 8 % of four probes and 6 % of the counts
    for share in (1.0, 4.0):
        gain = share * looked.mean / looked.variance
        ratio = looked.photon_noise(gain, samples=1) / excess(scene, radiance, gain, samples=1)
        assert 1 / close < ratio < close
        # The faults: a difference's variance for that of one of the two, a mean's for a sample's.
        for wrong in (2, 1 / PROBE_SAMPLES, 2 / PROBE_SAMPLES):
            assert not 1 / close < ratio * wrong < close


@pytest.mark.renders
def test_planned_samples_keep_rendering_noise_out_of_the_counts(
    scene: RenderScene, radiance: np.ndarray
) -> None:
    looked = probe(Capture(scene, GRID, "GRBG"), seed=1)
    gain = 0.295 * looked.mean / looked.variance
    samples = looked.samples_for(gain)
    assert samples == 30
    # The mean of n squared standard Poisson deviates, weighted by their rates, spreads by this.
    rates = gain * radiance
    spread = np.sqrt((2 * rates**2 + rates).sum() / DRAWS) / rates.sum()
    assert excess(scene, radiance, gain, samples) < MAX_NOISE_SHARE + 4 * spread
    assert excess(scene, radiance, gain, samples=1) > MAX_NOISE_SHARE + 4 * spread

"""Counts of a dataset: which way they are made, budgets within budgets, and what is written of them."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from scipy import stats

from pcii.base import InputError, silent
from pcii.store import COUNTS, MANIFEST, PHOTON_TRUTH, Dataset, nested_name, open_dataset
from pcii.types import Light, PhotonCounts, colour_index
from simgen.dataset import capture_of, draw_from_views, write_counts
from simgen.dataset.prepared import least_samples
from simgen.photons import MAX_NOISE_SHARE, Capture, Plan, probe, thin_photons
from simgen.photons import counting_plan as module
from simgen.photons.counting_plan import PROBE_SEED
from simgen.photons.light_probe import MAX_NORMALISER_ERROR
from simgen.renderer import RenderScene, backend, build
from simgen.sensor import PhotonTable, nested_subset
from simgen.spec import Recipe, Scene, load_scene

PLAN = Plan(thins=True, samples=1, photons_per_view=0.0, noise=0.0, normaliser_error=0.0)
BUDGETS = (120, 40, 8)
HEIGHT, WIDTH = 8, 10


def recipe(rows: int = 2, cols: int = 2, **changes: object) -> Recipe:
    """Few pixels whose films are as large as the scene."""
    grid = {"rows": rows, "cols": cols, "height": HEIGHT, "width": WIDTH, "pixel_mm": 4.0}
    return Recipe.model_validate(
        {"scene": "two_objects", "seed": 1, "grid": grid, "photons": nested()} | changes
    )


def nested(**photons: object) -> dict:
    return {"budget": BUDGETS[0], "nested": [8, 40], **photons}


def mosaic_of(k: int, l: int) -> np.ndarray:
    """A made-up view: bright and dim pixels, a dark one, each view brighter than the one before."""
    return (1 + 2 * k + l) * ((7 * np.arange(HEIGHT * WIDTH)) % 23.0).reshape(HEIGHT, WIDTH)


def planned(made: Recipe, render_scene: RenderScene, kind: str) -> Plan:
    capture = capture_of(made, render_scene, made.seed)
    return module.plan_counts(capture, kind, least_samples(made), may_explore=lambda _: False)


def thin(made: Recipe, render_scene: RenderScene, plan: Plan = PLAN) -> PhotonTable:
    return thin_photons(capture_of(made, render_scene, made.seed), plan)[0]


def without_scene(made: Recipe) -> Capture:
    """For counts that are drawn from made-up views."""
    no_scene: Any = None
    return capture_of(made, no_scene, made.seed)


def no_noise(k: int, l: int) -> np.ndarray:
    return np.zeros(3)


def dense(made: Recipe) -> PhotonTable:
    return draw_from_views(without_scene(made), mosaic_of, no_noise, PLAN, silent)[0]


@pytest.fixture(scope="module")
def two_objects() -> RenderScene:
    found = load_scene("two_objects")
    return build(backend.load(), found, found.folder or Path(), 3)


def counted(counts: PhotonTable, made: Recipe) -> np.ndarray:
    """Counts per pixel, (V, H, W)."""
    found = np.zeros(made.grid.camera_grid().shape_KLHW, dtype=np.int64)
    np.add.at(found, (counts.k, counts.l, counts.i, counts.j), counts.n)
    return found.reshape(-1, HEIGHT, WIDTH)


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


def is_poisson(totals: np.ndarray, budget: float) -> bool:
    """Whether mean and variance are those of as many Poisson numbers, within 4 standard errors."""
    n = totals.size
    mean_fits = abs(totals.mean() - budget) < 4 * np.sqrt(budget / n)
    return bool(mean_fits and abs(totals.var(ddof=1) - budget) < 4 * np.sqrt((budget + 2 * budget**2) / n))


@pytest.mark.parametrize(("scope", "draws"), [("view", 150), ("channel", 50), ("scene", 600)])
def test_totals_of_nested_budgets_are_poisson(scope: str, draws: int) -> None:
    totals: dict[int, list[np.ndarray]] = {budget: [] for budget in BUDGETS}
    for seed in range(draws):
        made = recipe(seed=seed, photons=nested(scope=scope))
        arrivals = dense(made)
        for budget, drawn in totals.items():
            drawn.append(by_scope(counted(subset(arrivals, made, budget), made), scope))
    found = {budget: np.concatenate(drawn) for budget, drawn in totals.items()}
    assert found[120].size >= 600
    for budget in BUDGETS:
        assert is_poisson(found[budget], budget)
        assert not is_poisson(2 * found[budget], budget)
    for budget, larger in ((40, 120), (8, 40)):
        always_a_part = np.rint(found[larger] * budget / larger)  # the faults: no chance in how many,
        always_as_many = np.full(found[larger].size, budget)  # or as many each time
        assert not is_poisson(always_a_part, budget)
        assert not is_poisson(always_as_many, budget)


@pytest.mark.renders
@pytest.mark.parametrize("scope", ["view", "channel", "scene"])
@pytest.mark.parametrize("thins", [True, False])
def test_multinomial_totals_of_nested_budgets_are_exact(
    two_objects: RenderScene, scope: str, thins: bool
) -> None:
    made = recipe(photons=nested(scope=scope, statistics="multinomial"))
    arrivals = thin(made, two_objects) if thins else dense(made)
    for budget in BUDGETS:
        totals = by_scope(counted(subset(arrivals, made, budget), made), scope)
        assert totals.tolist() == [budget] * {"view": 4, "channel": 12, "scene": 1}[scope]


@pytest.mark.parametrize("statistics", ["poisson", "multinomial"])
def test_each_budget_is_a_subset_of_the_next(statistics: str) -> None:
    made = recipe(photons=nested(statistics=statistics))
    arrivals = dense(made)
    belongs = [nested_subset(arrivals, arrivals, made.photons, budget, made.seed) for budget in (8, 40)]
    assert 0 < belongs[0].sum() < belongs[1].sum() < belongs[1].size
    assert (belongs[0] <= belongs[1]).all()
    larger = counted(arrivals.take(belongs[1]), made)
    # Budgets that are nearly the same: 100 times the smaller one might get more than the larger.
    near = recipe(10, 10, photons={"budget": 120, "nested": [38, 40], "statistics": statistics})
    many = dense(near)
    less, more = (nested_subset(many, many, near.photons, budget, near.seed) for budget in (38, 40))
    assert (less <= more).all()
    independent = counted(subset(dense(recipe(seed=2)), made, 8), made)
    assert (independent > larger).any()  # the fault: a smaller budget that was drawn by itself


def test_photons_of_a_smaller_budget_are_spread_like_the_light() -> None:
    views = np.stack([mosaic_of(k, l) for k, l in np.ndindex(2, 2)])
    expected, draws = 8 * views / views.sum(axis=(1, 2), keepdims=True), 150
    found, first_rows = np.zeros(views.shape), np.zeros(views.shape)
    for seed in range(draws):
        made = recipe(seed=seed)
        arrivals = dense(made)
        found += counted(subset(arrivals, made, 8), made)
        in_order = np.arange(arrivals.k.size)
        assert arrivals.scope is not None
        start = np.searchsorted(arrivals.scope, np.arange(4))
        first_rows += counted(arrivals.take(in_order - start[arrivals.scope] < 8), made)
    lit = expected > 0
    assert (found[~lit] == 0).all()

    def chi_square(pooled: np.ndarray) -> float:
        return float(((pooled - draws * expected)[lit] ** 2 / (draws * expected[lit])).sum())

    assert stats.chi2.sf(chi_square(found), lit.sum()) > 1e-3
    # The fault: a scope's first photons by their place on the film, not by chance.
    assert stats.chi2.sf(chi_square(first_rows), lit.sum()) < 1e-6


@pytest.mark.parametrize("statistics", ["poisson", "multinomial"])
def test_smaller_budgets_do_not_change_the_whole(statistics: str) -> None:
    alone = recipe(photons={"budget": BUDGETS[0], "statistics": statistics})
    together = recipe(photons=nested(statistics=statistics))
    one_by_one = dense(together)
    assert (one_by_one.n == 1).all()
    np.testing.assert_array_equal(counted(dense(alone), alone), counted(one_by_one, together))


def test_views_without_light_have_no_photons_of_any_budget() -> None:
    made = recipe(photons=nested(statistics="multinomial"))
    arrivals, log = draw_from_views(
        without_scene(made), lambda k, l: k * mosaic_of(k, l), no_noise, PLAN, silent
    )
    assert log["views_without_light"] == 2
    for budget in BUDGETS:
        assert by_scope(counted(subset(arrivals, made, budget), made), "view").tolist() == [0, 0] + 2 * [
            budget
        ]
    black, log = draw_from_views(
        without_scene(made), lambda k, l: 0 * mosaic_of(k, l), no_noise, PLAN, silent
    )
    assert log["views_without_light"] == 4
    assert subset(black, made, 8).k.size == 0


def test_too_many_photons_to_be_told_apart_are_refused_before_any_view_is_rendered(
    monkeypatch: pytest.MonkeyPatch, two_objects: RenderScene
) -> None:
    monkeypatch.setattr(module, "MAX_SINGLE_PHOTONS", 300)
    planned(recipe(grid=PROBED, photons={"budget": 120}), two_objects, "scalar")
    with pytest.raises(InputError, match=r"photons\.nested: .* photons are too many"):
        planned(recipe(grid=PROBED, photons=nested(budget=120)), two_objects, "scalar")


def stored(out: Path, made: Recipe, budget: float | None = None) -> np.ndarray:
    """The counts in a folder, (V, H, W)."""
    group = zarr.open_group(out / nested_name(COUNTS, budget), mode="r")
    columns = {name: np.asarray(group[name]) for name in "klijn"}
    counts = PhotonCounts.from_events(*columns.values(), grid=made.grid.camera_grid(), cfa=made.cfa)
    return np.stack([counts.view(k, l) for k, l in np.ndindex(made.grid.rows, made.grid.cols)])


FAULTY = {
    "quantum_efficiency": (0.8, 0.9, 0.7),
    "dark_counts": 0.05,
    "hot_pixel_share": 0.05,
    "hot_pixel_counts": 4.0,
    "dead_pixel_share": 0.05,
}


IN_FRAMES = FAULTY | {"bits": 1, "frames": 3}


@pytest.mark.parametrize("sensor", [{}, {"bits": 1}, FAULTY, FAULTY | {"bits": 2}, IN_FRAMES])
def test_what_is_written_is_nested_whatever_the_sensor(sensor: dict, tmp_path: Path) -> None:
    made = recipe(sensor=sensor)
    told = write_counts(without_scene(made), made.sensor, dense(made), tmp_path, with_origins=True)
    whole, middle, small = (stored(tmp_path, made, budget) for budget in (None, 40, 8))
    assert (small <= middle).all()
    assert (middle <= whole).all()
    assert small.sum() < middle.sum() < whole.sum()
    assert told["total"] == whole.sum()
    assert told["pixels_with_photons"] == (whole > 0).sum()
    assert told["nested"] == [
        {"budget": budget, "total": part.sum(), "pixels_with_photons": (part > 0).sum()}
        for budget, part in ((8, small), (40, middle))
    ]
    assert not (tmp_path / PHOTON_TRUTH).exists()  # rendered views do not know what a photon came from


def test_without_faults_what_arrives_is_what_is_written(tmp_path: Path) -> None:
    made = recipe(photons={"budget": 500})
    arrivals = dense(made)
    told = write_counts(without_scene(made), made.sensor, arrivals, tmp_path, with_origins=True)
    np.testing.assert_array_equal(stored(tmp_path, made), counted(arrivals, made))
    assert told["arrived"] == told["total"] == arrivals.n.sum()


def test_dark_counts_are_in_every_budget(tmp_path: Path) -> None:
    lost = recipe(sensor={"quantum_efficiency": (1e-9,) * 3, "dark_counts": 0.5})
    write_counts(without_scene(lost), lost.sensor, dense(lost), tmp_path, with_origins=True)
    whole, small = stored(tmp_path, lost), stored(tmp_path, lost, 8)
    np.testing.assert_array_equal(whole, small)
    assert abs(whole.sum() - 0.5 * whole.size) < 4 * np.sqrt(0.5 * whole.size)


def from_known_places(made: Recipe) -> PhotonTable:
    """Photons in random order; each of an object and from a depth that tell its pixel."""
    rng = np.random.default_rng(1)
    shape = made.grid.camera_grid().shape_KLHW
    flat = rng.integers(0, np.prod(shape), 900)
    ones = np.ones(flat.size, dtype=np.int64)
    k, l, i, j = np.unravel_index(flat, shape)
    return PhotonTable(k, l, i, j, ones, 0 * ones, np.arange(flat.size), flat + 1, flat + 0.5)


@pytest.mark.parametrize(
    "sensor", [{}, FAULTY | {"hot_pixel_counts": 20.0}, FAULTY | {"bits": 2}, IN_FRAMES | {"frames": 40}]
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
    lamp = {"type": "area", "position_mm": (300, 0, 100), "target_mm": (0, 0, 500), "luminance_cd_m2": 100.0}
    backdrop = {"z_mm": 500.0, "reflectance": (0.8, 0.8, 0.8)}
    lamp |= {"width_mm": 300.0, "height_mm": 300.0}
    found = Scene.model_validate({"title": "a wall", "lights": [lamp], "backdrop": backdrop})
    return build(backend.load(), found, Path(), 3)


@pytest.mark.renders
def test_what_is_made_in_either_way_is_exact_at_every_budget(
    two_objects: RenderScene, wall: RenderScene
) -> None:
    ways = set()
    for scene in (two_objects, wall):
        for kind in ("llvm", "scalar"):
            assert planned(recipe(grid=PROBED, photons={"budget": 10}), scene, kind).thins
            for budget in (1e3, 1e7, 1e9):
                made = planned(recipe(grid=PROBED, photons={"budget": budget}), scene, kind)
                assert made.thins or made.noise <= MAX_NOISE_SHARE
                assert made.keeps_origins == (6 * budget <= module.MAX_SINGLE_PHOTONS)
                ways.add((made.thins, made.keeps_origins))
    assert len(ways) == 4


@pytest.mark.renders
@pytest.mark.parametrize("light", [{"photons": {"budget": 1e13}}, {"photons": {"scope": "exposure"}}])
def test_more_photons_than_can_be_exact_are_refused_with_how_many_can(
    two_objects: RenderScene, light: dict[str, Any]
) -> None:
    bright = recipe(grid=PROBED, exposure={"time_s": 1e6}, **light)
    with pytest.raises(InputError, match="more than can be made without rendering noise; at most") as refused:
        planned(bright, two_objects, "llvm")
    most = float(str(refused.value).split()[-3])
    if bright.photons.scope == "view":
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
    np.testing.assert_array_equal(counted(summed, made), counted(kept, made))


@pytest.mark.renders
@pytest.mark.parametrize(
    "scope", [{"photons": {"budget": 3e4}}, {"photons": {"scope": "exposure"}, "exposure": {}}]
)
def test_all_seeds_of_a_recipe_are_made_alike(two_objects: RenderScene, scope: dict[str, Any]) -> None:
    # Not only near break-even: the samples of dense views are the same too.
    plans = [planned(recipe(grid=PROBED, seed=seed, **scope), two_objects, "llvm") for seed in range(1, 5)]
    assert plans == plans[:1] * 4


@pytest.mark.renders
@pytest.mark.parametrize(
    ("scope", "budget", "pixels"), [("view", 250, 4096), ("channel", 84, 1024), ("scene", 1500, 6 * 4096)]
)
def test_a_budget_is_divided_by_light_that_is_known_well(
    two_objects: RenderScene, scope: str, budget: float, pixels: int
) -> None:
    dim = recipe(grid=PROBED, photons={"budget": budget, "scope": scope})
    seen = probe(capture_of(dim, two_objects, 1), PROBE_SEED)
    made = planned(dim, two_objects, "llvm")
    error = np.sqrt(seen.variance / (made.samples * pixels)) / seen.mean
    assert made.normaliser_error == pytest.approx(error)
    assert error <= MAX_NORMALISER_ERROR
    share = made.samples / (
        made.samples - 1
    )  # and one sample less would be too few for this or for the counts
    assert error * np.sqrt(share) > MAX_NORMALISER_ERROR or made.noise * share > MAX_NOISE_SHARE


def exposed(built: RenderScene, photons_per_view: float, **changes: Any) -> Recipe:
    """No budget, but an exposure that brings about so many photons."""

    def of(time_s: float) -> Recipe:
        scope = {"scope": "exposure"}
        return recipe(grid=PROBED, photons=scope, exposure={"time_s": time_s}, **changes)

    found = planned(of(1e-9), built, "scalar").photons_per_view
    return of(1e-9 * photons_per_view / found)


@pytest.mark.renders
def test_a_plan_takes_more_samples_for_more_light(two_objects: RenderScene) -> None:
    plans = [planned(exposed(two_objects, n), two_objects, "scalar") for n in (0.1, 10, 40, 1e6)]
    samples = [made.samples for made in plans]
    assert samples[0] == 1
    assert samples[0] < samples[1] < samples[2] < samples[3]
    assert all(made.noise <= MAX_NOISE_SHARE for made in plans)
    images = {"products": {"radiance": "rgb"}, "render": {"samples_per_pixel": 33}}
    with_images = exposed(two_objects, 1, **images)
    assert planned(with_images, two_objects, "scalar").samples == 33


@pytest.mark.renders
def test_darkness_is_planned_too() -> None:
    light = {"type": "uniform", "luminance_cd_m2": 1.0}
    wall = {"title": "dark", "lights": [light], "backdrop": {"z_mm": 500.0}}
    dark = build(backend.load(), Scene.model_validate(wall), Path(), 3)
    for kind in ("llvm", "scalar"):
        made = planned(recipe(grid=PROBED, photons={"budget": 1000}), dark, kind)
        assert (made.thins, made.samples, made.noise, made.normaliser_error) == (False, 1, 0, 0)
        exposed = recipe(grid=PROBED, photons={"scope": "exposure"}, exposure={})
        assert not planned(exposed, dark, kind).thins
    # What the virtual centre sees says nothing about how large a budget is.
    with pytest.raises(InputError, match=r"photons\.nested: 6e\+12 photons are too many"):
        planned(recipe(grid=PROBED, photons=nested(budget=1e12)), dark, "llvm")


def views_of(dataset: Dataset) -> np.ndarray:
    return np.stack([dataset.counts.view(k, l) for k, l in np.ndindex(2, 3)])


@pytest.mark.renders
def test_a_dataset_opens_at_each_of_its_budgets(nested_dataset: Path) -> None:
    dataset = open_dataset(nested_dataset)
    whole, middle, small = (views_of(dataset.at_light(Light(n))) for n in (400, 120, 30))
    assert (small <= middle).all()
    assert (middle <= whole).all()
    for views, budget in ((whole, 400), (middle, 120), (small, 30)):
        # Six views of so many photons and 38 dark counts: a Poisson total, within 5 standard deviations.
        expected = 6 * (budget + 0.01 * 64 * 60)
        assert abs(views.sum() - expected) < 5 * np.sqrt(expected)
    np.testing.assert_array_equal(whole, views_of(dataset))
    reached = dataset.at_light(Light(30))  # from which another can be
    assert (dataset.light, reached.light) == (Light(400), Light(30))
    np.testing.assert_array_equal(views_of(reached.at_light(Light(400))), whole)
    manifest = json.loads((nested_dataset / MANIFEST).read_text())
    assert {"counts.zarr", "counts-30.zarr", "counts-120.zarr"} <= {
        name.split("/")[0] for name in manifest["files"]
    }
    assert [entry["budget"] for entry in manifest["photons"]["nested"]] == [30, 120]


@pytest.mark.renders
def test_photons_of_every_budget_know_their_origin(nested_dataset: Path) -> None:
    whole = open_dataset(nested_dataset)
    for dataset in (whole, whole.at_light(Light(120)), whole.at_light(Light(30))):
        assert dataset.truth is not None
        photons = dataset.truth.photons
        assert photons is not None
        assert photons.k.size == dataset.counts.total
        dark = photons.object_id == -1
        # 6 views of 38.4 dark counts each.
        assert abs(dark.sum() - 230.4) < 4 * np.sqrt(230.4)
        assert np.isinf(photons.z_mm[dark]).all()
        assert set(np.unique(photons.object_id)) == {-1, 0, 1, 2}

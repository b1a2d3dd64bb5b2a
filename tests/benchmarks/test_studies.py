"""Studies: figures on small arrays, peers, skips that give the same bytes, records, pages and times."""

import inspect
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from property_settings import mostly_slow

from benchmarks import __main__ as command
from benchmarks.figures import curve, frame
from benchmarks.guard import losses, reference_of
from benchmarks.page import write_page
from benchmarks.peers import plain_pipeline
from benchmarks.peers.shifted_means import by_opencv, by_scipy, by_slices
from benchmarks.results import Measured, Record, Row, Study, Value, read_record, write_record
from benchmarks.skip_pairs import SKIPS, World
from benchmarks.studies import STUDIES, radiance_images, sections, skips
from benchmarks.studies.photon_images import Rates, distances
from benchmarks.studies.sections import Texture, plane_views
from benchmarks.studies.skips import are_same, random_world
from benchmarks.timing import median_of, ratio_of, side_by_side
from pcii.base import InputError
from pcii.sections import reconstruct
from pcii.types import CameraGrid, Views

RATES = np.random.default_rng(5).uniform(0.2, 1.8, (2, 64, 64)) / 64**2
BUDGET = 5.0 * 64**2


def counts_of(rates: np.ndarray, repeats: int, noise: float) -> np.ndarray:
    """Poisson counts (R, V, H, W) whose rates are off by this standard deviation relative to them."""
    rng = np.random.default_rng(7)
    size = repeats, *rates.shape
    off = rng.gamma(1 / noise**2, noise**2, size) if noise else np.ones(size)
    return rng.poisson(BUDGET * rates * off)


def test_poisson_counts_have_no_distance_and_noise_of_rendering_shows() -> None:
    found = distances(counts_of(RATES, 8, 0), Rates(RATES, 0 * RATES), BUDGET)
    # Standard errors: 2 x 64 x 64 x 7 degrees of freedom give 0.6 %, 256 tiles-and-repeats some 6 %.
    assert found["dispersion"].value == pytest.approx(1, abs=0.03)
    assert found["tile_chi_square"].value == pytest.approx(1, abs=0.25)
    assert found["rmse_of_mean"].value == pytest.approx(1, abs=0.05)
    low, high = found["dispersion"].low or np.inf, found["dispersion"].high or 0
    assert low < 1.01
    assert high > 0.99

    found = distances(counts_of(RATES, 8, 0.5), Rates(RATES, 0 * RATES), BUDGET)
    # Variance of a rate r is 0.25 r^2 more, and the mean of r^2 over that of r is 5 (1 + 0.8^2 / 3) = 6.07.
    assert found["dispersion"].value == pytest.approx(1 + 0.25 * 6.07, rel=0.05)


def test_wrong_rates_show_in_tiles_and_noise_of_the_truth_does_not() -> None:
    wrong = RATES.copy()
    wrong[:, :32] *= 1.2
    counts = counts_of(RATES, 4, 0)
    assert distances(counts, Rates(wrong, 0 * RATES), BUDGET)["tile_chi_square"].value > 5
    allowed = distances(counts, Rates(wrong, (0.2 * wrong) ** 2 * 256), BUDGET)
    assert allowed["tile_chi_square"].value < 1


def test_errors_of_sections_are_relative_to_the_contrast() -> None:
    truth = np.full((64, 64, 1), 0.5)
    found = truth + 0.03
    found[20, 20] = np.nan
    errors = sections.errors(found, truth, 8)
    assert errors["rmse_percent"].value == pytest.approx(20)
    assert errors["covered_percent"].value == pytest.approx(100 * (1 - 1 / 48**2))


@pytest.mark.parametrize("black_rows", [0, 500])
def test_bias_is_distinguished_from_noise_on_what_is_lit(black_rows: int) -> None:
    rng, truth = np.random.default_rng(3), np.zeros((32 + black_rows, 32, 3))
    truth[:32] = 1
    noisy = truth + truth * rng.normal(0, 0.5, (8, *truth.shape))
    fair, biased = (
        radiance_images.errors((noisy + bias * truth).astype(np.float32), truth) for bias in (0, 0.2)
    )
    assert fair["rmse_percent"].value == pytest.approx(50, rel=0.03)
    assert fair["bias_percent"].value < 4
    assert biased["bias_percent"].value == pytest.approx(20, rel=0.1)


def test_a_difference_of_one_byte_is_a_difference() -> None:
    one = {"a": np.array([1.0, np.nan]), "b": np.zeros(2, np.int64)}
    assert skips.are_same(one, {name: each.copy() for name, each in one.items()})
    assert not skips.are_same(one, one | {"b": np.array([0, 1])})
    assert not skips.are_same(one, {"a": one["a"]})


# Three cameras a side and a whole disparity: all shifts are whole, and all peers are exact.
GRID = CameraGrid(rows=3, cols=3, pitch_mm=(4.0, 4.0), focal_mm=1.0, pixel_mm=1.0, height=32, width=36)
IMAGES = np.random.default_rng(2).random(GRID.shape_KLHW, dtype=np.float32)
INNER = np.s_[5:-5, 5:-5]


def test_peers_make_the_section_that_we_make() -> None:
    expected = reconstruct(Views(IMAGES[..., None], GRID), 1.0).estimate[0, ..., 0][INNER]
    for peer in (by_scipy, by_slices):
        assert peer(IMAGES, GRID, 1.0)[INNER] == pytest.approx(expected, abs=1e-6)
    pytest.importorskip("cv2")
    assert by_opencv(IMAGES, GRID, 1.0)[INNER] == pytest.approx(expected, abs=1e-6)


def test_the_plain_script_moves_views_as_we_do() -> None:
    total, squares = plain_pipeline.stack(IMAGES.astype(np.float64), 1.0, 4.0)
    assert total / 9 == pytest.approx(by_slices(IMAGES, GRID, 1.0), abs=1e-6)
    assert (squares[INNER] / 9 >= (total[INNER] / 9) ** 2 - 1e-9).all()


def test_views_of_the_texture_meet_at_its_depth() -> None:
    texture = Texture()
    (views,) = plane_views(texture, 3.0, 48, [None])
    pixels = np.arange(48)
    found = reconstruct(views, 1.0).estimate[0, ..., 0]
    inner = np.s_[16:-16, 16:-16]
    # With ten cameras and a whole disparity, nearest shifts round half up: half a pixel in each axis.
    error = found - texture.seen_at(pixels - 0.5, pixels - 0.5)[..., 1]
    off = found - texture.seen_at(pixels + 2, pixels)[..., 1]
    assert np.abs(error[inner]).mean() < 0.5 * np.abs(off[inner]).mean()


EXACT = {skip.name: skip for skip in SKIPS if skip.exact}
QUICK = [name for name in EXACT if name.startswith(("exploration", "visibility"))]


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    found = random_world(2, 32, tmp_path_factory.mktemp("world"))
    found.prepare_all()
    return found


@pytest.mark.renders
@pytest.mark.parametrize("name", mostly_slow(EXACT, quick=QUICK))
def test_skipped_work_is_not_missed(world: World, name: str) -> None:
    skip = EXACT[name]
    on, off = skip.on(world, f"{skip.name}, on"), skip.off(world, f"{skip.name}, off")
    assert on
    assert are_same(on, off)


TIMES = {"time_ms": Value(2.0, 1.5, 2.5), "rmse_percent": Value(0.125)}
MEASURED = Measured(
    rows=[
        Row("Errors", "ours", {"samples": 4}, TIMES),
        Row("Errors", "theirs <b>", {"samples": 16}, {"time_ms": Value(8.0)}),
        Row("Memory", "ours", {}, {"peak_mb": Value(1234.0)}),
    ],
    ratios={"ours against theirs": Value(4.0, 3.5, 4.5), "memory": Value(1.5)},
    seeds=[1, 2],
)
MACHINE = {"processor": "abacus", "cores": 2, "renderer": "scalar_rgb", "cores_in_use": 0.1}
VERSIONS = {"commit": "abc", "numpy": "2.1"}
RECORD = Record("nothing", "quick", "2026-01-02T03:04:05+00:00", 12.5, MACHINE, VERSIONS, MEASURED)


def draw(figure: Any, measured: Measured) -> None:
    axes = figure.subplots()
    curve(axes, measured.of("Errors"), "samples", "time_ms", "both", 0)
    frame(axes, "samples", "time_ms", "title")


def reading(measured: Measured) -> str:
    return f"Ours takes {measured.one('Errors', 'ours').values['time_ms'].value:g} ms. Two. Three."


STUDY = Study("nothing", "A study of nothing", {"quick": {}, "full": {}}, lambda: MEASURED, draw, reading)


def with_ratios(**ratios: float) -> Record:
    """The record with these ratios instead."""
    measured = Measured(MEASURED.rows, {name: Value(ratio) for name, ratio in ratios.items()})
    return replace(RECORD, measured=measured)


def test_a_record_reads_as_it_was_written_and_other_files_are_refused_by_name(tmp_path: Path) -> None:
    write_record(tmp_path, RECORD)
    path = tmp_path / "nothing.json"
    assert read_record(path) == RECORD
    for text in ('{"study": "nothing"}', "{"):
        path.write_text(text)
        with pytest.raises(InputError, match=r"nothing\.json: expected results of a study"):
            read_record(path)


def test_a_run_prints_its_tables_and_leaves_results_for_a_page(tmp_path: Path, capsys: Any) -> None:
    made = command.measure(STUDY, "quick", tmp_path)
    assert read_record(tmp_path / "nothing.json").measured == made.measured
    assert made.versions["numpy"]
    assert "| ours | 4 | 2 (1.5 to 2.5) | 0.125 |" in capsys.readouterr().out
    write_page(tmp_path / "page.md", [STUDY], [RECORD])
    text = (tmp_path / "page.md").read_text()
    assert "![A study of nothing](benchmarks/nothing.png)" in text
    for words in (
        "Ours takes 2 ms. Two. Three.",
        "| ours against theirs | 4 (3.5 to 4.5) |",
        "abacus, 2 cores",
    ):
        assert words in text
    with Image.open(tmp_path / "benchmarks" / "nothing.png") as picture:
        assert min(picture.size) > 300


def test_every_study_has_both_sizes_and_they_fit() -> None:
    names = [study.name for study in STUDIES]
    assert len(set(names)) == len(names)
    for study in STUDIES:
        assert set(study.sizes) == {"quick", "full"}
        for size in study.sizes.values():
            inspect.signature(study.measure).bind(**size)


def test_a_ratio_that_is_gone_nan_or_a_quarter_less_is_a_loss() -> None:
    reference = reference_of([with_ratios(fast=10.0, slow=2.0)])
    for ratios, lost in (
        ({"fast": 7.6, "slow": 2.5}, []),
        ({"fast": 7.4, "slow": 2.0}, ["nothing, fast: 7.4 instead of 10, 26% less"]),
        ({"slow": 2.0}, ["nothing, fast: was 10 and is not measured any more"]),
    ):
        assert losses([with_ratios(**ratios)], reference) == lost
    assert len(losses([with_ratios(fast=float("nan"), slow=2.0)], reference)) == 1


def test_the_command_exits_with_1_on_a_planted_loss(tmp_path: Path, monkeypatch: Any, capsys: Any) -> None:
    study, results = command.STUDIES[0].name, tmp_path / "bench"
    monkeypatch.setattr(command, "REFERENCE", tmp_path / "reference.json")
    command.REFERENCE.write_text(json.dumps({study: {"size": "quick", "ratios": {"speed": 8.0}}}))
    monkeypatch.setattr("sys.argv", ["benchmarks", "guard", "--out", str(results)])
    for ratio, code in ((8.0, 0), (5.9, 1)):
        write_record(results, replace(with_ratios(speed=ratio), study=study))
        assert command.main() == code
    assert f"lost: {study}, speed: 5.9 instead of 8" in capsys.readouterr().out


def test_works_take_turns_and_the_first_round_is_not_counted() -> None:
    calls: list[tuple[str, int]] = []
    works = {name: lambda n, name=name: calls.append((name, n)) for name in "ab"}
    seconds = side_by_side(works, repeats=2)
    assert calls == [("a", 0), ("b", 0), ("a", 1), ("b", 1), ("a", 2), ("b", 2)]
    assert {name: len(taken) for name, taken in seconds.items()} == {"a": 2, "b": 2}


def test_intervals_of_medians_are_order_statistics_and_ratios_are_taken_round_by_round() -> None:
    # Both ends of 6 miss the median with the probability 2 / 2^6 = 3 %, of 5 with 6 %.
    assert median_of([1.0, 2.0, 3.0, 4.0, 5.0]).low is None
    six = median_of([6.0, 1.0, 5.0, 2.0, 4.0, 3.0], scale=10)
    assert (six.value, six.low, six.high) == (35, 10, 60)
    # Of 12 the third on either side: 2 (1 + 12 + 66) / 2^12 = 3.9 %.
    twelve = median_of([float(n) for n in range(1, 13)])
    assert (twelve.low, twelve.high) == (3, 10)
    # Were they of medians, the slow third round of both would count.
    assert ratio_of([2.0, 4.0, 90.0], [1.0, 1.0, 30.0], scale=10).value == 30

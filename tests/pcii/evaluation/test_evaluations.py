"""Evaluations of made-up methods, every figure by hand; killed, shared, locked and refused."""

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from command_runs import run_pcii
from stored_datasets import rewrite_manifest
from tiny_datasets import NESTED, OWN, by_count, two_rows, write_dataset

from pcii.base import Executor, InputError
from pcii.evaluation import Evaluation, evaluate, find_datasets, read_frame, read_rows
from pcii.removal import METHODS
from pcii.store import ROWS, TRUTH, open_dataset, read_manifest, verify
from pcii.types import DepthMap

HITS = {3: (6, 10), 4: (8, 10), 5: (7, 10)}  # of ten pixels, by seed: at the own budget and the nested one
FAKES = ("by count", "two rows")


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Makes the fake methods known; every call of one is noted."""
    noted: list[str] = []
    for method in (by_count, two_rows):
        name = method.__name__.replace("_", " ")

        def noting(counts: Any, z_mm: Any, name: str = name, method: Any = method) -> Any:
            noted.append(name)
            return method(counts, z_mm)

        monkeypatch.setitem(METHODS, name, noting)
    return noted


def write_series(folder: Path) -> Path:
    for seed, (own, nested) in HITS.items():
        write_dataset(folder / f"seed_{seed}", seed, {NESTED: nested, OWN: own})
    return folder


@pytest.fixture
def series(tmp_path: Path) -> Path:
    return write_series(tmp_path / "data")


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory: pytest.TempPathFactory) -> Evaluation:
    """The fake methods compared on the series."""
    folder = tmp_path_factory.mktemp("evaluated")
    with pytest.MonkeyPatch.context() as patch:
        for name, method in zip(FAKES, (by_count, two_rows), strict=True):
            patch.setitem(METHODS, name, method)
        return evaluate([write_series(folder / "data")], folder / "out", methods=FAKES)


def mean_of(evaluation: Evaluation, light: object, method: str, measure: str) -> Any:
    """Row of `means` of one light, method and measure."""
    table = evaluation.means()
    is_it = (table["light"] == light) & (table["method"] == method) & (table["measure"] == measure)
    (row,) = table[is_it].itertuples()
    return row


def test_every_figure_by_hand(evaluated: Evaluation) -> None:
    frame = evaluated.frame
    # Three datasets in two lights, by two methods, at two planes.
    assert len(frame) == 3 * 2 * 2 * 2
    assert frame["light"].cat.categories.tolist() == [NESTED, OWN]
    assert set(frame["scene"]) == {"by hand"}
    is_own = (frame["light"] == OWN) & (frame["method"] == "by count")
    own: Any = frame[is_own].set_index(["z_mm", "seed"])
    assert own.loc[1.0, "iou"].to_dict() == {3: 0.6, 4: 0.8, 5: 0.7}
    assert own.loc[2.0, "iou"].to_dict() == {3: 1.0, 4: 1.0, 5: 1.0}
    assert own.loc[2.0, "false_share"].tolist() == [0.0] * 3
    assert own.loc[1.0, "objects"].tolist() == ["near"] * 3
    assert own["photon_recall"].isna().all()  # these photons have no known origin
    # Over both planes 0.8, 0.9, 0.85: half width 4.302653 * 0.05 / sqrt(3) = 0.124207.
    iou = mean_of(evaluated, OWN, "by count", "iou")
    assert (iou.n, iou.mean) == (3, pytest.approx(0.85))
    assert (iou.low, iou.high) == (pytest.approx(0.725793, abs=1e-6), pytest.approx(0.974207, abs=1e-6))
    # Of 24 pixels the near object is 10, the far one 0, in every dataset.
    assert mean_of(evaluated, OWN, "two rows", "iou").mean == pytest.approx(10 / 24 / 2)
    assert mean_of(evaluated, OWN, "two rows", "claimed_share")[-4:] == (3, 0.25, 0.25, 0.25)
    # Of 96 pixels each object is ten.
    assert mean_of(evaluated, OWN, "(everything)", "iou").mean == pytest.approx(10 / 96)
    assert mean_of(evaluated, OWN, "(nothing)", "iou").mean == 0.0
    # 96 photons in the last view and 20 + 6, 8, 7 in the first, of four views.
    photons = mean_of(evaluated, OWN, "by count", "photons_per_view")
    assert photons.mean == pytest.approx((96 + 20 + 7) / 4)


def test_the_files_hold_the_same_figures(evaluated: Evaluation) -> None:
    out = evaluated.folder
    assert verify(out) == len({ROWS, "evaluation.html", "means.csv"})
    pd.testing.assert_frame_equal(read_frame(out), evaluated.frame)
    table = pd.read_csv(out / "means.csv")
    iou = table[(table["measure"] == "iou") & (table["light"] == OWN)].set_index("method")
    assert iou.at["by count", "mean"] == mean_of(evaluated, OWN, "by count", "iou").mean
    page = (out / "evaluation.html").read_text()
    assert "://" not in page
    assert str(out.parent) not in page
    rows = [re.findall("<t[hd][^>]*>(.*)</t[hd]>", row) for row in page.split("<tr>")]
    # Equal differences of the nested light, 1 - 10 / 48, have an interval without width.
    mean, difference = "0.208 (0.208 to 0.208)", "-0.792 (-0.792 to -0.792)"
    assert ["two rows", "20", "2", mean, difference, "0.25", "0.25", "3"] in rows
    best = [f"<strong>{text}</strong>" for text in ("1.000 (1.000 to 1.000)", "0.850 (0.726 to 0.974)")]
    assert ["by hand", "by count", *best] in rows


def test_curves_are_of_the_means(evaluated: Evaluation) -> None:
    axes = evaluated.plot("iou", style="paper")
    assert len(axes) == 2  # against photons and against seconds
    means = [mean_of(evaluated, light, "by count", "iou").mean for light in (NESTED, OWN)]
    curves = [list(container.lines[0].get_ydata()) for container in axes[0].containers]
    assert means in curves
    with pytest.raises(InputError, match=r"^measure: no method has 'within_1px'"):
        evaluated.plot("within_1px")


def change_recipe(dataset: Path, **settings: Any) -> None:
    manifest = read_manifest(dataset)
    rewrite_manifest(dataset, recipe=manifest.recipe | settings, identity=f"{manifest.identity}{settings}")


def test_scenes_come_in_the_order_of_the_datasets_with_the_settings_that_differ(
    tmp_path: Path, calls: list[str]
) -> None:
    data = [write_dataset(tmp_path / f"data {number}", 1, {OWN: 2 + number}) for number in range(4)]
    change_recipe(data[1], scene="another", grid={"rows": 4}, exposure=None)
    change_recipe(data[2], scene="another", grid={"rows": 6}, exposure=None)
    change_recipe(data[3], title="of its own")  # the manifest's `title` stays the same
    other = write_dataset(tmp_path / "other", 1, {OWN: 9}, title="other")
    evaluation = evaluate([other, *data[::-1]], tmp_path / "out", methods=["by count"])
    labels = list(evaluation.frame["scene"].cat.categories)
    ious = evaluation.frame.groupby("scene", observed=True)["iou"].mean().round(6).tolist()
    assert ious == [0.95, 0.75, 0.7, 0.65, 0.6]
    assert labels[0] == "other"
    assert labels[2] == "by hand (scene=another, grid.rows=6, exposure=null)"
    # These two have the same settings, and differ by the hashes of their recipes.
    assert all(re.fullmatch(r"by hand \(scene=by hand, recipe [0-9a-f]{8}\)", labels[n]) for n in (1, 4))
    # Scenes of earlier runs come last.
    again = evaluate(data[:1], tmp_path / "out", methods=["by count"])
    assert list(again.frame["scene"].cat.categories) == [labels[4], *labels[:4]]


def test_amounts_of_light_of_one_scene_are_one_scene_however_they_came_about(
    series: Path, tmp_path: Path, calls: list[str]
) -> None:
    """Datasets of one budget each, as a sweep makes them, give the figures of those with nested budgets."""
    single: list[Path] = []
    for seed, (own, nested) in HITS.items():
        for light, hits in ((OWN, own), (NESTED, nested)):
            single.append(write_dataset(tmp_path / f"{light}_{seed}", seed, {light: hits}))
            change_recipe(single[-1], photons={"budget": light, "nested": [], "scope": "view"})
    swept = evaluate(single, tmp_path / "swept", methods=FAKES)
    nested = evaluate([series], tmp_path / "nested", methods=FAKES)
    assert list(swept.frame["scene"].cat.categories) == ["by hand"]
    for one, other in ((swept.means(), nested.means()), (swept.ranks(), nested.ranks())):
        assert len(one) == len(other) > 0
    iou = mean_of(swept, OWN, "by count", "iou")
    assert iou[-4:] == mean_of(nested, OWN, "by count", "iou")[-4:]
    assert iou.n == len(HITS)
    change_recipe(single[0], photons={"budget": OWN, "nested": [], "scope": "channel"})
    assert evaluate(single, tmp_path / "out", methods=FAKES).frame["scene"].nunique() == 2


def test_what_is_measured_is_not_measured_again(series: Path, tmp_path: Path, calls: list[str]) -> None:
    evaluate([series], tmp_path / "out", methods=["by count"])
    assert len(calls) == 3 * 2 + 2  # a row for each dataset and light, and one call that warms up by light
    first = read_rows(tmp_path / "out")
    stages = list[tuple[str, int, int]]()
    methods = [*FAKES, "by count"]
    evaluate(
        [series, series / "seed_3"], tmp_path / "out", methods=methods, report=lambda *s: stages.append(s)
    )
    assert stages[0] == ("scores of an earlier run", 6, 6)
    assert stages[-1] == ("scores", 6, 6)
    assert set(calls[8:]) == {"two rows"}
    assert read_rows(tmp_path / "out")[:6] == first


def check_same_but_for_seconds(one: Evaluation, other: Evaluation) -> None:
    first, second = (each.frame.drop(columns="seconds") for each in (one, other))
    pd.testing.assert_frame_equal(first, second)


def near_plane(data: Any, z_range_mm: tuple[float, float]) -> DepthMap:
    return DepthMap(np.ones((8, 12)), np.ones((8, 12)))


def test_functions_are_compared_like_methods_with_a_name(series: Path, tmp_path: Path) -> None:
    """By one process and by two, which share the work."""
    methods = [by_count, ("rows", two_rows), ("depth:near", near_plane), "brightness"]
    options: dict[str, Any] = {"methods": methods, "budgets": [OWN]}
    evaluation = evaluate([series], tmp_path / "alone", **options)
    assert mean_of(evaluation, OWN, "by_count", "iou").mean == pytest.approx(0.85)
    assert mean_of(evaluation, OWN, "rows", "iou").mean == pytest.approx(10 / 48)
    assert mean_of(evaluation, OWN, "depth:near", "within_1px").mean == 0.5
    shared = evaluate([series], tmp_path / "out", **options, executor=Executor(2))
    check_same_but_for_seconds(shared, evaluation)
    # Nobody knows what they follow from, so they are measured whenever they are named.
    again = evaluate([series], tmp_path / "out", **options).made_again
    assert again == ("9 scores of by_count, depth:near, rows, since what makes them is not known",)
    assert evaluate([series], tmp_path / "out", methods=["brightness"], budgets=[OWN]).made_again == ()


MISNAMED: list[tuple[list[Any], str]] = [
    ([by_count, ("by_count", two_rows)], "methods: 'by_count' is there twice"),
    ([("three-step", by_count)], "methods: the name 'three-step' is taken"),
    ([("(nothing)", by_count)], r"methods: expected a name of characters .*, got '\(nothing\)'"),
    (["guess"], "method: there is no method named 'guess'; use depth, .*, depth:sweep-17"),
]


def test_a_killed_evaluation_goes_on_where_it_was(
    evaluated: Evaluation, tmp_path: Path, calls: list[str]
) -> None:
    out = tmp_path / "killed"
    shutil.copytree(evaluated.folder, out)
    *lines, last, _ = (out / ROWS).read_bytes().split(b"\n")
    (out / ROWS).write_bytes(b"\n".join(lines) + b"\n" + last[:-1])  # killed in the middle of a line
    again = evaluate([evaluated.folder.parent / "data"], out, methods=FAKES)
    assert len(calls) == 2  # the torn row, and its warm-up
    check_same_but_for_seconds(again, evaluated)
    assert len((out / ROWS).read_bytes().splitlines()) == len(lines) + 1


def test_a_run_that_fails_keeps_what_it_measured_and_a_second_one_is_refused(
    series: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"

    def breaks(counts: Any, sections: Any) -> Any:
        with pytest.raises(InputError, match="out: another run writes here; wait for its end"):
            evaluate([series], out, methods=["brightness"])
        if counts.total == open_dataset(series / "seed_5").counts.total:
            raise InputError("this photon is one too many")
        return by_count(counts, sections)

    monkeypatch.setitem(METHODS, "breaks", breaks)
    with pytest.raises(InputError, match="one too many"):
        evaluate([series], out, methods=["breaks"], budgets=[OWN])
    assert len(read_rows(out)) == 2
    with pytest.raises(InputError, match=r"out: not a finished evaluation .*; `pcii evaluate` makes one"):
        verify(out)


def test_what_cannot_be_evaluated_is_refused_before_any_work(
    series: Path, tmp_path: Path, calls: list[str]
) -> None:
    out = tmp_path / "out"
    for methods, sentence in MISNAMED:
        with pytest.raises(InputError, match=f"^{sentence}"):
            evaluate([series], out, methods=methods)
    (tmp_path / "more" / "seed_9").mkdir(parents=True)
    with pytest.raises(InputError, match="seed_9: not a finished dataset"):
        evaluate([tmp_path / "more"], out, methods=FAKES)
    with pytest.raises(InputError, match="has no budget 7; there are 20, 50"):
        evaluate([series], out, methods=FAKES, budgets=[7])
    files = read_manifest(series / "seed_3").files.items()
    rewrite_manifest(series / "seed_3", files={name: entry for name, entry in files if TRUTH not in name})
    with pytest.raises(InputError, match="has no truth"):
        evaluate([series], out, methods=FAKES)
    assert calls == []
    assert not out.exists()


def test_depths_are_given_where_the_recipe_names_none(
    series: Path, tmp_path: Path, calls: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    for path in find_datasets([series]):
        rewrite_manifest(path, analysis={})
    command = ["evaluate", str(series), "-o", str(out), "--method", "by count"]
    assert run_pcii(*command) == 2
    assert "suggests no depths; name depths with --z-mm" in capsys.readouterr().err
    assert run_pcii(*command, "--z-mm", "1", "--z-mm", "2") == 0
    assert "evaluation.html" in capsys.readouterr().out
    calls.clear()
    evaluation = evaluate([series], out, methods=["by count"], z_mm=[1, 2])
    assert calls == []  # nothing is measured twice
    assert mean_of(evaluation, OWN, "by count", "iou").mean == pytest.approx(0.85)
    # Other depths are another scene, with figures of their own.
    evaluate([series], out, methods=["by count"], z_mm=[1])
    evaluation = evaluate([series], out, methods=["by count"], z_mm=[1, 2])
    frame, means = evaluation.frame, evaluation.means()
    is_yardstick = (means["method"] == "(everything)") & (means["measure"] == "iou") & (means["light"] == OWN)
    # Both objects are nearest to the only plane: 20 of 96 pixels; else 10 at either.
    assert means[is_yardstick].set_index("scene")["mean"].to_dict() == pytest.approx(
        {"by hand (analysis.z_mm=[1.0])": 20 / 96, "by hand (analysis.z_mm=[1.0, 2.0])": 10 / 96}
    )
    depths = frame.groupby("scene", observed=True)["z_mm"].unique().map(sorted).to_dict()
    assert depths == {"by hand (analysis.z_mm=[1.0])": [1], "by hand (analysis.z_mm=[1.0, 2.0])": [1, 2]}


def test_depth_where_no_object_is_scored(tmp_path: Path) -> None:
    """Has confidence, which the page shows, and no share of depths within 1 px."""
    data = write_dataset(tmp_path / "data", 1, {OWN: 10})
    rewrite_manifest(data, unscored=[1, 2])
    evaluation = evaluate([data], tmp_path / "out", methods=["depth:variance-sweep"])
    assert evaluation.frame["within_1px"].isna().all()
    assert "share of correct depths against confidence" in (tmp_path / "out/evaluation.html").read_text()

"""Methods of depth in an evaluation: names, lights, bounds beside them, and figures by hand."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny_datasets import NESTED, OWN, write_dataset

from pcii.app import commands as cli
from pcii.app.results import Results
from pcii.base import command_line
from pcii.base.errors import InputError
from pcii.depth.methods import FOR_COUNTS, estimate_depth
from pcii.evaluation.comparison import evaluate
from pcii.evaluation.evaluation_pages import write_evaluation
from pcii.evaluation.rows import all_rows, claim_rows
from pcii.evaluation.summary import summarise
from pcii.evaluation.tables import depth_overview, tables_of
from pcii.evaluation.tasks import tasks_of
from pcii.metrics.bounds import object_bounds
from pcii.removal.methods import removal_methods
from pcii.sections.reconstruction import reconstruct
from pcii.store.dataset import FULL_LIGHT, Dataset, open_dataset
from pcii.store.dataset_writer import save_dataset
from pcii.types.camera_grid import CameraGrid
from pcii.types.estimates import DepthMap
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts
from pcii.types.truth import Truth

GRID = CameraGrid(rows=2, cols=3, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.25, height=40, width=48)
COUNTS = PhotonCounts.from_dense(np.random.default_rng(1).poisson(0.5, GRID.shape_KLHW), GRID)
LIGHT = Views(np.random.default_rng(0).random((*GRID.shape_KLHW, 3)).astype(np.float32), GRID)
IDS = np.zeros((40, 48), np.int16)
IDS[8:32, 8:32] = 1
TRUTH = Truth(np.where(IDS > 0, 500.0, np.inf), IDS, {1: "card"})
OF_COUNTS = ["depth:posterior", "depth:focus", "depth:likelihood-sweep", "depth:variance-sweep"]
OF_VIEWS = ["depth:posterior", "depth:variance-sweep", "depth:structure-tensor"]


def saved(path: Path, images: Any, **depths: Any) -> Dataset:
    depths = depths or {"z_mm": [500, 700], "z_range_mm": (450, 800)}
    return save_dataset(path, images, TRUTH, title=path.name, **depths)


def rows_of(out: Path) -> list[dict[str, Any]]:
    with all_rows(out) as rows:
        return rows


def named(out: Path) -> set[tuple[Any, str]]:
    return {(row["budget"], row["method"]) for row in rows_of(out)}


def chosen(datasets: list[Dataset], *methods: str, budgets: Sequence[Any] = ()) -> list[tuple[str, Any, str]]:
    tasks = tasks_of(datasets, dict.fromkeys(methods), budgets)
    return [(task.dataset.name, task.budget, task.method) for task in tasks]


def test_without_names_every_method_is_scored_on_all_that_it_takes(tmp_path: Path) -> None:
    both, alone = saved(tmp_path / "both", (COUNTS, LIGHT)), saved(tmp_path / "alone", LIGHT)
    nested = open_dataset(write_dataset(tmp_path / "nested", 1, {NESTED: 5, OWN: 5}))
    of_counts = [*removal_methods(), *OF_COUNTS]
    assert chosen([both, alone, nested]) == [
        *(("both", None, name) for name in of_counts),
        *(("both", FULL_LIGHT, name) for name in OF_VIEWS),
        *(("alone", FULL_LIGHT, name) for name in OF_VIEWS),
        *(("nested", budget, name) for budget in (NESTED, OWN) for name in of_counts),
    ]
    # Of what is named each method takes what it can.
    assert chosen([both, nested], "depth:variance-sweep", "variance", budgets=[]) == [
        ("both", None, "depth:variance-sweep"),
        ("both", None, "variance"),
        ("both", FULL_LIGHT, "depth:variance-sweep"),
        *(
            ("nested", budget, name)
            for budget in (NESTED, OWN)
            for name in ("depth:variance-sweep", "variance")
        ),
    ]
    assert chosen([nested], "depth", budgets=["20"]) == [("nested", NESTED, "depth:posterior")]


def test_full_light_is_a_budget_by_name_and_depth_means_the_default(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    both, out = saved(tmp_path / "both", (COUNTS, LIGHT)), tmp_path / "out"
    methods = ("depth", "depth:posterior", "depth:variance-sweep")
    command = ["evaluate", str(both.path), "-o", str(out), *(f"--method={method}" for method in methods)]
    assert command_line.run(cli.app, [*command, "--budget", FULL_LIGHT]) == 0
    assert named(out) == {(FULL_LIGHT, method) for method in methods[1:]}
    page = (out / "evaluation.html").read_text()
    assert "<td>full light</td>" in page
    assert page.count("data:image/png;base64,") == 2  # errors, and reliability
    assert command_line.run(cli.app, [*command, "--budget", "bright"]) == 2
    assert "budget: expected a number of photons or 'full-light', got 'bright'" in capsys.readouterr().err
    (group,) = evaluate([both.path], out, methods=["depth"])["groups"]
    assert [row["photons_per_view"] is None for row in group["results"]] == [False, True, True]
    assert depth_overview([group]).header == ("scene", "method", "by exposure", "full light")
    assert len(rows_of(out)) == 3


def test_single_commands_look_at_full_light_and_run_takes_a_method_of_depth(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    both = saved(tmp_path / "both", (COUNTS, LIGHT))
    at_light = [str(both.path), "--budget", FULL_LIGHT]
    expected = estimate_depth(LIGHT, (450, 800), method="structure-tensor")
    for number, (command, option) in enumerate([("depth", "--method"), ("run", "--depth-method")]):
        out = tmp_path / str(number)
        asked = [command, *at_light, option, "structure-tensor", "-o", str(out)]
        assert command_line.run(cli.app, asked) == 0
        depth = Results(out, both.at_budget(FULL_LIGHT)).load_depth()
        assert depth is not None
        np.testing.assert_array_equal(depth.z_mm, expected.z_mm)
    assert (
        "--depth-method structure-tensor --budget full-light" in (tmp_path / "1" / "report.html").read_text()
    )
    capsys.readouterr()
    assert command_line.run(cli.app, ["segment", *at_light, "-o", str(tmp_path / "no")]) == 2
    assert "full-light is the radiance, and this needs photon counts" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("has", "methods", "budgets", "sentence"),
    [
        ("counts", ["depth:structure-tensor"], [], "'depth:structure-tensor' needs radiance, and of .*; use"),
        ("both", ["depth:structure-tensor"], [OWN], "no photons of budget 50"),
        ("views", ["likelihood"], [], "'likelihood' needs photon counts, and of .*alone radiance would"),
        ("both", ["depth", "variance"], [FULL_LIGHT], "'variance' needs photon counts"),
        ("views", ["depth:focus"], [], "use depth:posterior, depth:variance-sweep, depth:structure-tensor$"),
        ("counts", [], [FULL_LIGHT], "has no radiance, and budget 'full-light' is of that"),
        ("both", ["focus"], [], "no method named 'focus'; use depth, .*, depth:focus"),
        ("views", [], [300], "no photons of budget 300 here"),
    ],
)
def test_what_a_method_cannot_take_is_refused_before_any_work(
    tmp_path: Path, has: str, methods: list[str], budgets: list[Any], sentence: str
) -> None:
    images = {"counts": COUNTS, "views": LIGHT, "both": (COUNTS, LIGHT)}[has]
    data = saved(tmp_path / "alone", images)
    with pytest.raises(InputError, match=sentence):
        evaluate([data.path], tmp_path / "out", methods=methods, budgets=budgets)
    assert not (tmp_path / "out").exists()


def test_without_depths_of_planes_removal_is_left_out(tmp_path: Path) -> None:
    ranged = saved(tmp_path / "ranged", COUNTS, z_range_mm=(450, 800))
    assert chosen([ranged]) == [("ranged", None, name) for name in OF_COUNTS]
    with pytest.raises(InputError, match="names no depths"):
        chosen([ranged], "variance")


def test_a_range_of_depths_that_cannot_be_searched_is_refused_before_any_work(tmp_path: Path) -> None:
    near = saved(tmp_path / "near", COUNTS, z_mm=[500], z_range_mm=(0.5, 800))
    with pytest.raises(InputError, match=r"near: z_range_mm: from .* choose a farther near end"):
        chosen([near], "depth")


def test_the_bound_of_an_objects_depth_stands_beside_it_where_there_is_radiance(tmp_path: Path) -> None:
    both, dark = saved(tmp_path / "both", (COUNTS, LIGHT)), saved(tmp_path / "dark", COUNTS)
    group_of = {
        group["title"]: group
        for group in evaluate([both.path, dark.path], tmp_path / "out", methods=["depth", "variance"])[
            "groups"
        ]
    }
    z_mm = [500, 700]
    (expected,) = object_bounds(TRUTH, reconstruct(LIGHT, z_mm), reconstruct(COUNTS, z_mm))
    rows = {(row["dataset"], row["budget"], row["method"]): row for row in rows_of(tmp_path / "out")}
    assert expected["depth_sigma_px"] > 0
    assert rows["both", None, "depth:posterior"]["bounds"] == {"objects": [expected]}
    assert "bounds" not in rows["both", None, "variance"]
    assert "bounds" not in rows["both", FULL_LIGHT, "depth:posterior"]
    assert "bounds" not in rows["dark", None, "depth:posterior"]
    (bound,) = group_of["both"]["results"][0]["bounds"]["objects"]
    assert (bound["name"], bound["photons"]["mean"]) == ("card", expected["photons"])
    assert bound["depth_sigma_px"]["mean"] == expected["depth_sigma_px"]
    tables = {table.title: table for table in tables_of(group_of["both"])}
    assert tables["Least error of an object's depth (Cramér-Rao bound)"].rows == (
        ("card", "by exposure", f"{expected['photons']}", f"{expected['depth_sigma_px']:.3f}"),
    )


def test_a_method_of_depth_is_timed_and_scored_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def right(counts: PhotonCounts, z_range_mm: tuple[float, float]) -> DepthMap:
        return DepthMap(np.full((40, 48), 500.0), np.full((40, 48), 0.75))

    monkeypatch.setitem(FOR_COUNTS, "right", right)
    data = saved(tmp_path / "data", COUNTS)
    evaluation = evaluate([data.path], tmp_path / "out", methods=["depth:right"])
    (row,) = evaluation["groups"][0]["results"]
    assert (row["depth"]["bad_1px"]["mean"], row["depth"]["coverage"]["mean"]) == (0.0, 1.0)
    # 24 x 24 of 40 x 48 pixels are of the card, and around it is nothing.
    assert row["depth"]["ece"]["mean"] == pytest.approx(0.75 - 0.3)
    assert row["depth"]["reliability"]["0.7-0.8"]["correct"]["mean"] == pytest.approx(0.3)


def depth_row(seed: int, budget: Any, method: str, bad_1px: float, **depth: Any) -> dict[str, Any]:
    return {
        "dataset": f"seed_{seed}", "identity": str(seed), "seed": seed,
        "recipe": "r", "title": "t", "scene": "s",
        "budget": budget, "method": method, "seconds": 1.0,
        "photons_per_view": None if budget == FULL_LIGHT else budget,
        "depth": {"bad_1px": bad_1px, **depth},
    }  # fmt: skip


def test_methods_of_depth_are_compared_by_errors_and_worse_means_more() -> None:
    bad = {
        (30.0, "depth:a"): (0.25, 0.5), (300.0, "depth:a"): (0.5, 0.75), (FULL_LIGHT, "depth:a"): (0.25, 0.5),
        (30.0, "depth:b"): (0.5, 0.75), (300.0, "depth:b"): (0.25, 0.5),
    }  # fmt: skip
    rows = [
        depth_row(seed, *cell, share) for cell, shares in bad.items() for seed, share in enumerate(shares)
    ]
    (group,) = summarise(rows[::-1])["groups"]
    assert [(row["budget"], row["method"]) for row in group["results"]] == [
        (30.0, "depth:a"), (30.0, "depth:b"), (300.0, "depth:a"), (300.0, "depth:b"), (FULL_LIGHT, "depth:a")
    ]  # fmt: skip
    at_30, at_300 = group["paired"]
    assert (at_30["methods"], at_30["measure"]) == (["depth:a", "depth:b"], "bad_1px")
    assert (at_30["difference"]["mean"], at_300["difference"]["mean"]) == (-0.25, 0.25)
    # a rises by 0.25 from 30 to 300 and falls again at full light; b falls, which is for the better.
    (loss,) = group["monotonic"]
    assert (loss["method"], loss["from"], loss["to"], loss["measure"]) == ("depth:a", 30.0, 300.0, "bad_1px")
    assert loss["difference"]["interval"] == [0.25, 0.25]


def test_reliability_is_averaged_over_the_seeds_that_have_a_bin() -> None:
    def bins(share: float, confidence: float | None, correct: float | None) -> dict[str, Any]:
        return {"0.9-1.0": {"share": share, "confidence": confidence, "correct": correct}}

    rows = [
        depth_row(1, 30.0, "depth:a", 0.5, ece=0.25, reliability=bins(1.0, 0.96, 0.5)),
        depth_row(2, 30.0, "depth:a", 0.5, ece=0.75, reliability=bins(0.5, 0.92, 0.25)),
        depth_row(3, 30.0, "depth:a", 0.5, ece=None, reliability=None),
        depth_row(4, 30.0, "depth:a", 0.5, ece=0.5, reliability=bins(0.0, None, None)),
    ]
    depth = summarise(rows)["groups"][0]["results"][0]["depth"]
    assert (depth["ece"]["n"], depth["ece"]["mean"]) == (3, 0.5)
    one = depth["reliability"]["0.9-1.0"]
    assert (one["share"]["n"], one["share"]["mean"]) == (3, 0.5)
    assert (one["confidence"]["n"], one["confidence"]["mean"]) == (2, pytest.approx(0.94))
    assert (one["correct"]["n"], one["correct"]["mean"]) == (2, 0.375)


def test_rows_of_an_earlier_release_are_still_summed_up(tmp_path: Path) -> None:
    claim_rows(tmp_path)
    rows = [
        depth_row(seed, budget, "depth", bad)
        for seed in (1, 2)
        for budget, bad in ((30.0, 0.25), (300.0, 0.5))
    ]
    evaluation = summarise(rows)
    write_evaluation(tmp_path, evaluation)
    assert json.loads((tmp_path / "evaluation.json").read_text())["groups"] == evaluation["groups"]
    text = (tmp_path / "evaluation.md").read_text()
    assert "| depth | 300 | 2 | 0.500 (0.500 to 0.500) |" in text
    assert (
        "bad_1px of depth is higher with 300 photons than with 30, by 0.250 (0.250 to 0.250)."
        in text.replace("\\", "")
    )

"""What an evaluation measures: methods of depth, lights, bounds beside them, and what is refused."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny_datasets import NESTED, OWN, write_dataset

from pcii.app import commands as cli
from pcii.app import load_estimates
from pcii.base import InputError, command_line
from pcii.depth import estimate_depth
from pcii.evaluation import evaluate, named_methods, read_rows, tasks_of
from pcii.metrics import object_bounds
from pcii.removal import removal_methods
from pcii.sections import reconstruct
from pcii.store import Dataset, open_dataset, save_dataset
from pcii.types import CameraGrid, Light, PhotonCounts, Truth, Views

GRID = CameraGrid(rows=2, cols=3, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.25, height=40, width=48)
COUNTS = PhotonCounts.from_dense(np.random.default_rng(1).poisson(0.5, GRID.shape_KLHW), GRID)
LIGHT = Views(np.random.default_rng(0).random((*GRID.shape_KLHW, 3)).astype(np.float32), GRID)
IDS = np.zeros((40, 48), np.int16)
IDS[8:32, 8:32] = 1
TRUTH = Truth(np.where(IDS > 0, 500.0, np.inf), IDS, {1: "card"})
OF_COUNTS = ["depth:posterior", "depth:sweep-17", "depth:variance-sweep"]
FULL_LIGHT = "full-light"
OF_VIEWS = ["depth:posterior", "depth:variance-sweep", "depth:structure-tensor"]


def saved(path: Path, images: Any, **depths: Any) -> Dataset:
    depths = depths or {"z_mm": [500, 700], "z_range_mm": (450, 800)}
    return save_dataset(path, images, TRUTH, title=path.name, **depths)


def chosen(datasets: list[Dataset], *methods: str, lights: Sequence[Any] = ()) -> list[tuple[str, Any, str]]:
    tasks = tasks_of(datasets, named_methods(methods), lights)
    return [(task.dataset.name, task.light.stored, task.method.name) for task in tasks]


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
    assert chosen([both], "depth:variance-sweep", "brightness") == [
        ("both", None, "depth:variance-sweep"),
        ("both", None, "brightness"),
        ("both", FULL_LIGHT, "depth:variance-sweep"),
    ]
    assert chosen([nested], "depth", lights=[Light(20)]) == [("nested", NESTED, "depth:posterior")]


def test_full_light_is_a_budget_by_name_and_depth_means_the_default(tmp_path: Path) -> None:
    both, out = saved(tmp_path / "both", (COUNTS, LIGHT)), tmp_path / "out"
    methods = ("depth", "depth:posterior", "depth:variance-sweep")
    command = ["evaluate", str(both.path), "-o", str(out), *(f"--method={method}" for method in methods)]
    assert command_line.run(cli.app, [*command, "--budget", FULL_LIGHT]) == 0
    rows = {(row["budget"], row["method"]) for row in read_rows(out)}
    assert rows == {(FULL_LIGHT, method) for method in methods[1:]}
    frame = evaluate([both.path], out, methods=["depth"]).frame
    assert frame["light"].cat.categories.tolist() == ["by exposure", FULL_LIGHT]
    assert frame["photons_per_view"].isna().tolist() == [False, True, True]


def test_single_commands_look_at_full_light_and_run_takes_a_method_of_depth(tmp_path: Path) -> None:
    both = saved(tmp_path / "both", (COUNTS, LIGHT))
    at_light = [str(both.path), "--budget", FULL_LIGHT]
    expected = estimate_depth(LIGHT, (450, 800), method="structure-tensor")
    for number, (command, option) in enumerate([("depth", "--method"), ("run", "--depth-method")]):
        out = tmp_path / str(number)
        arguments = [command, *at_light, option, "structure-tensor", "-o", str(out)]
        assert command_line.run(cli.app, arguments) == 0
        _, depth = load_estimates(out, both.at_light(Light.parse(FULL_LIGHT)))
        assert depth is not None
        np.testing.assert_array_equal(depth.z_mm, expected.z_mm)


@pytest.mark.parametrize(
    ("has", "methods", "budgets", "sentence"),
    [
        ("counts", ["depth:structure-tensor"], [], "'depth:structure-tensor' needs radiance, and of .*; use"),
        ("views", ["posterior"], [], "'posterior' needs photon counts, and of .*alone radiance would"),
        ("counts", [], [FULL_LIGHT], "has no budget full-light; there are exposure"),
    ],
)
def test_what_a_method_cannot_take_is_refused_before_any_work(
    tmp_path: Path, has: str, methods: list[str], budgets: list[Any], sentence: str
) -> None:
    data = saved(tmp_path / "alone", {"counts": COUNTS, "views": LIGHT}[has])
    with pytest.raises(InputError, match=sentence):
        evaluate([data.path], tmp_path / "out", methods=methods, budgets=budgets)
    assert not (tmp_path / "out").exists()


def test_depths_that_are_missing_or_too_near(tmp_path: Path) -> None:
    """Without planes removal is left out, and refused by name; a range that cannot be searched is refused."""
    ranged = saved(tmp_path / "ranged", COUNTS, z_range_mm=(450, 800))
    assert chosen([ranged]) == [("ranged", None, name) for name in OF_COUNTS]
    with pytest.raises(InputError, match="suggests no depths"):
        chosen([ranged], "brightness")
    near = saved(tmp_path / "near", COUNTS, z_mm=[500], z_range_mm=(0.5, 800))
    with pytest.raises(InputError, match=r"near: z_range_mm: from .* choose a farther near end"):
        chosen([near], "depth")


def test_the_bound_of_an_objects_depth_stands_beside_it_where_there_is_radiance(tmp_path: Path) -> None:
    both, dark = saved(tmp_path / "both", (COUNTS, LIGHT)), saved(tmp_path / "dark", COUNTS)
    frame = evaluate([both.path, dark.path], tmp_path / "out", methods=["depth", "brightness"]).frame
    z_mm = [500, 700]
    (expected,) = object_bounds(TRUTH, reconstruct(LIGHT, z_mm), reconstruct(COUNTS, z_mm))
    assert expected["depth_sigma_px"] > 0
    known = frame[frame["bound_px"].notna()]
    assert known[["dataset", "light", "method", "bound_px"]].to_numpy().tolist() == [
        ["both", "by exposure", "depth:posterior", expected["depth_sigma_px"]]
    ]
    assert ">bound, px</th>" in (tmp_path / "out" / "evaluation.html").read_text()

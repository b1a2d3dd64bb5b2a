"""Depth and removal by every method: time against error over photon budgets, and the bound beside.

The scenes are some that ship, on films of fewer and larger pixels. All methods see the same photons.
"""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.figures import curve, frame
from benchmarks.results import Measured, Parameter, Row, Size, Study, Value, value_of
from benchmarks.scenes import film
from pcii.base import Stages
from pcii.evaluation import depth_name, evaluate, means
from pcii.evaluation.evaluation_page import lines_of
from pcii.evaluation.method_names import estimator_of, methods_for
from pcii.evaluation.summary import SWEEPS
from simgen.dataset import generate_collection
from simgen.spec import load_sweep

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

DEPTH, REMOVAL, BOUND = "Depth", "Removal of defocused points", "Least error of the depth of whole objects"
MEASURES = {
    "median_px": "median_px",
    "within_1px_percent": "within_1px",
    "badpix_007_percent": "hci_objects.badpix_007",
    "mse_x100": "hci_objects.mse_x100",
    "answered_percent": "coverage",
}
"""Columns of depth: errors of total disparity on objects, and metrics of the HCI benchmark there."""
MASKS = {"iou": "iou", "boundary_f": "boundary_f", "iou_by_pixel": "pixel_iou"}
DEFAULT = depth_name("posterior")
MIN_PERCENT = 0.1
"""Shares of depths within 1 px below this are as good as none when a ratio is taken."""

SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {
        "names": ("paper", "slats"),
        "rows": 5,
        "side_px": 128,
        "seeds": 3,
        "budgets": (100, 1000, 10000),
    },
    "full": {
        "names": ("paper", "slats", "natural_balls", "plain_pair"),
        "rows": 10,
        "side_px": 512,
        "seeds": 10,
        "budgets": (30, 100, 1000, 10000, 100000),
    },
}


def measure(names: Sequence[str], rows: int, side_px: int, seeds: int, budgets: Sequence[int]) -> Measured:
    """All methods on recipes that ship, with `rows` x `rows` cameras of `side_px` x `side_px` pixels."""
    pitch_mm = 45 * 2 / (rows - 1)  # twice the paper's span, so that coarse pixels tell depths apart
    *nested, most = sorted(budgets)
    settings = [
        *film(side_px), f"grid.rows={rows}", f"grid.cols={rows}", f"grid.pitch_mm=[{pitch_mm}, {pitch_mm}]",
        f"photons.budget={most}", f"photons.nested={nested}", "products.visibility=false",
        "products.radiance=mosaic", "render.samples_per_pixel=32",
    ]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder, Stages() as progress:
        datasets: list[Path] = []
        for name in names:
            sweep = load_sweep(name, [*settings, f"title={name}"], seeds=seeds)
            generate_collection(sweep, Path(folder) / name, report=progress)
            datasets += [Path(folder) / name / sweep.folder(number) for number in range(seeds)]
        evaluation = evaluate(
            datasets,
            Path(folder) / "scores",
            methods=methods_for(full_light=False),
            budgets=budgets,
            report=progress,
        )
    table = _rows(means(evaluation.frame))
    return Measured(table, _ratios(table), sorted({*evaluation.frame["seed"].astype(int).tolist()}))


def _rows(means: "DataFrame") -> list[Row]:
    """Rows of every scene, light and method, and of the bounds."""
    rows: list[Row] = []
    bounds: dict[tuple[str, float], Row] = {}
    groups: Any = means.groupby(["scene", "light", "method"], observed=True)
    for (scene, light, method), group in groups:
        of = {row.measure: row for row in lines_of(group)}
        where: dict[str, Parameter] = {"scene": scene, "photons_per_view": float(light)}
        is_depth = estimator_of(method) is not None
        columns = {"time_ms": "seconds"} | (MEASURES if is_depth else MASKS)
        scales = {
            name: 1e3 if name == "time_ms" else 100 if name.endswith("percent") else 1 for name in columns
        }
        values = {name: value_of(of[key], scales[name]) for name, key in columns.items() if key in of}
        rows.append(Row(DEPTH if is_depth else REMOVAL, method, where, values))
        if "bound_px" in of:
            bounds[scene, light] = Row(
                BOUND, "Cramer-Rao bound", where, {"sigma_px": value_of(of["bound_px"])}
            )
    return [*rows, *bounds.values()]


def _ratios(rows: list[Row]) -> dict[str, Value]:
    """How many times more depths the default method has within 1 px than the best plane sweep."""
    measured, sweeps = Measured(rows), {*map(depth_name, SWEEPS)}
    ratios: dict[str, Value] = {}
    for row in measured.of(DEPTH):
        if row.name == DEFAULT:
            others = [each for each in measured.of(DEPTH, **row.parameters) if each.name in sweeps]
            ours, best = (
                max(MIN_PERCENT, *(each.values["within_1px_percent"].value for each in some))
                for some in ([row], others)
            )
            name = f"{row.parameters['scene']}, {row.parameters['photons_per_view']:g} photons: depths within"
            ratios[f"{name} 1 px by {DEFAULT} against the best sweep"] = Value(ours / best)
    return ratios


def draw(figure: "Figure", measured: Measured) -> None:
    """Error of depth and masks against time, of the first scene; lines go from few photons to many."""
    scene = measured.rows[0].parameters["scene"]
    panels = figure.subplots(1, 3)
    for axes, table, x, y in (
        (panels[0], DEPTH, "time_ms", "within_1px_percent"),
        (panels[1], DEPTH, "photons_per_view", "median_px"),
        (panels[2], REMOVAL, "time_ms", "iou"),
    ):
        rows = measured.of(table, scene=scene)
        for number, method in enumerate(dict.fromkeys(row.name for row in rows)):
            curve(axes, [row for row in rows if row.name == method], x, y, method, number)
        if y == "median_px":
            curve(axes, measured.of(BOUND, scene=scene), x, "sigma_px", "bound of whole objects", 7)
        frame(axes, x, y, f"{table}: {scene}", log="xy" if y == "median_px" else "x")


def reading(measured: Measured) -> str:
    """How to read it: the default methods at the fewest and the most photons of the first scene."""
    scene = measured.rows[0].parameters["scene"]
    budgets = sorted({float(row.parameters["photons_per_view"]) for row in measured.of(DEPTH, scene=scene)})

    def of(table: str, name: str, budget: float, quantity: str) -> float:
        return measured.one(table, name, scene=scene, photons_per_view=budget).values[quantity].value

    few, many = budgets[0], budgets[-1]
    return (
        "How good are depth and masks for their time, and how far from what light allows? The default"
        f" posterior has {of(DEPTH, DEFAULT, few, 'within_1px_percent'):.0f} % of the"
        f" objects' pixels within 1 px of their depth with {few:g} photons per view and"
        f" {of(DEPTH, DEFAULT, many, 'within_1px_percent'):.0f} % with {many:g}; dashed bounds are standard"
        " deviations of whoever knows an object's texture and that all of it lies at one depth. IoU by the"
        f" network goes from {of(REMOVAL, 'posterior', few, 'iou'):.2f} to"
        f" {of(REMOVAL, 'posterior', many, 'iou'):.2f}, by the paper's three steps from"
        f" {of(REMOVAL, 'three-step', few, 'iou'):.2f} to {of(REMOVAL, 'three-step', many, 'iou'):.2f}."
    )


STUDY = Study(
    "depth-and-focus", "Depth and focus", SIZES, measure, draw, reading, width_in=13.0, height_in=4.4
)

"""Tables of means and ranks as texts, for pages of an evaluation and for terminals."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.depth import FOR_COUNTS
from pcii.evaluation.method_names import depth_name
from pcii.evaluation.summary import (
    LOOK_AT_NO_PHOTON,
    MORE_IS_BETTER,
    Over,
    lines_of,
    over_scenes,
    ranked_over,
    ranks,
)
from pcii.figures import NOT_KNOWN, emphasised, text_table

if TYPE_CHECKING:
    from pandas import DataFrame, Series

TITLES = {"iou": "IoU", "within_1px": "Share of depths within 1 px"}
"""What methods of removal and of depth are compared by, more being better."""
SWEEPS = (*(name for name in FOR_COUNTS if "sweep" in name), "sweep-9", "sweep-33")
"""Plane sweeps, and two that no longer ship, which rows of the benchmark are of."""
SIMPLE = (*LOOK_AT_NO_PHOTON, *map(depth_name, SWEEPS))
"""What any method should beat."""
NOT_BETTER = "†"
"""Mark of a mean that is no better than the best of `SIMPLE` for the same scene and light."""
REMOVAL = {
    "iou": "IoU",
    "pixel_iou": "IoU, pixels",
    "boundary_f": "boundary F",
    "false_share": "claimed falsely",
    "photon_precision": "photon precision",
    "photon_recall": "photon recall",
    "seconds": "seconds",
}
"""Measures of removal in tables, and the names of their columns."""
DEPTH = {
    "within_1px": "within 1 px",
    "within_3px": "within 3 px",
    "coverage": "answered",
    "quadratic_score": "quadratic score",
    "brier": "Brier",
    "median_px": "median, px",
    "bound_px": "bound, px",
    "bias_px": "bias, px",
    "hci_objects.badpix_007": "BadPix(0.07)",
    "hci.badpix_007": "BadPix(0.07), all pixels",
    "ece": "ECE",
    "seconds": "seconds",
}
"""The same of depth."""
MAX_DETAILED_SCENES = 12
"""Largest number of scenes with tables of all measures: a page with those of more is too large to load."""


def with_interval(mean: float, low: float, high: float, digits: int = 3) -> str:
    """A mean with its interval as text, a dash for NaN.

    >>> with_interval(0.912, 0.905, 0.919), with_interval(0.912, float("nan"), float("nan"))
    ('0.912 (0.905 to 0.919)', '0.912')
    """
    if np.isnan(mean):
        return NOT_KNOWN
    text = f"{mean:.{digits}f}"
    return text if np.isnan(low) else f"{text} ({low:.{digits}f} to {high:.{digits}f})"


def light_name(light: float | str) -> str:
    """A light of the frame as the name of a column or plot.

    >>> light_name(300.0), light_name("full-light"), light_name("by exposure")
    ('300', 'full light', 'by exposure')
    """
    return light.replace("-", " ") if isinstance(light, str) else f"{light:g}"


def tables_of(frame: "DataFrame", cell_means: "DataFrame") -> Iterator[tuple[str, "DataFrame"]]:
    """Of removal, then of depth: ranks, the decisive measure by scene and light, and all measures.

    Each has its title. `frame` is of `summary.with_yardsticks`, `cell_means` its means by scene, light and
    method.
    """
    for (decisive, title), names in zip(TITLES.items(), (REMOVAL, DEPTH), strict=True):
        means = cell_means[cell_means["measure"] == decisive]
        if not len(means):
            continue
        ranked = ranks(frame, decisive)
        if len(ranked):
            unit = ranked_over(frame, decisive)
            yield f"{title}, methods compared on the same {unit}", rank_table(ranked, unit)
        yield f"{title} by photons per view", mean_table(means, ["scene", "method"], "light", light_name)
        if frame["scene"].nunique() <= MAX_DETAILED_SCENES:
            yield f"{title} beside other measures", _measure_table(cell_means, means, names)


def decisive_means(cell_means: "DataFrame") -> Iterator[tuple[str, str]]:
    """Of removal, then of depth, as far as there is any: a title, and means by method and light as lines."""
    means = over_scenes(cell_means)
    for measure, title in TITLES.items():
        of_measure = means[means["measure"] == measure]
        if len(of_measure):
            table = of_measure.pivot(index="method", columns="light", values="mean").sort_index(
                axis="columns"
            )
            table = table.rename(columns={light: light_name(light) for light in table.columns})
            table.index.name = table.columns.name = None
            yield title, table.to_string(float_format="{:.3f}".format, na_rep=NOT_KNOWN)


def _measure_table(cell_means: "DataFrame", means: "DataFrame", names: Mapping[str, str]) -> "DataFrame":
    """The measures `names` of the methods in `means`, by scene, light and method."""
    import pandas as pd

    is_shown = cell_means["measure"].isin(list(names)) & cell_means["method"].isin(means["method"].unique())
    shown = cell_means[is_shown]
    shown = shown.assign(measure=pd.Categorical(shown["measure"], list(names)))
    return mean_table(shown, ["scene", "light", "method"], "measure", lambda name: names[name])


def mean_table(
    means: "DataFrame",
    rows: Sequence[str],
    column: str,
    name: Callable[[Any], str] = str,
    full_n: int = 0,
    bound: str = "",
) -> "DataFrame":
    """Means with their intervals: `means` has the columns `rows`, and a column is made for each of `column`.

    Of `MORE_IS_BETTER` the best method of a scene (if rows are of scenes) and light stands out, where another
    is worse, and `NOT_BETTER` marks methods that are no better than the best of `SIMPLE`; `bound`
    names what is no method. Means of fewer than `full_n` values have their number.
    """
    import pandas as pd

    contest = [key for key in ("scene", "light", "measure") if key in means]
    methods = means["method"].astype(object)
    is_simple = methods.isin(SIMPLE)
    values = means["mean"].where(means["measure"].isin(MORE_IS_BETTER) & (methods != bound))

    def best_of(some: "Series") -> "Series":
        return some.groupby([means[key] for key in contest], observed=True).transform("max")

    is_best = (values == best_of(values)) & (values > -best_of(-values))
    is_marked = ~is_simple & (values <= best_of(values.where(is_simple)))
    texts: list[str] = []
    for row in lines_of(means[["mean", "low", "high", "n"]].assign(is_best=is_best, is_marked=is_marked)):
        number = f" of {row.n}" if row.n < full_n else ""
        text = with_interval(row.mean, row.low, row.high) + number + f" {NOT_BETTER}" * row.is_marked
        texts.append(emphasised(text) if row.is_best else text)
    cells = means.assign(text=pd.Series(texts, means.index, dtype=object))
    table = cells.pivot(index=list(rows), columns=column, values="text").sort_index(axis="columns")
    table = table.fillna(NOT_KNOWN).set_axis([*map(name, table.columns)], axis="columns").reset_index()
    if "light" in table:
        table["light"] = [*map(light_name, table["light"])]
    return table.set_index([*rows])


def rank_table(table: "DataFrame", unit: Over) -> "DataFrame":
    """Methods ranked over scenes or datasets; `table` is of `summary.ranks`."""
    rows = [
        (
            row.method,
            light_name(row.light),
            str(row.rank),
            with_interval(row.mean, row.low, row.high),
            with_interval(row.difference, row.difference_low, row.difference_high),
            *(NOT_KNOWN if np.isnan(p) else f"{p:.2g}" for p in (row.p, row.least_p)),
            str(row.n),
        )
        for row in lines_of(table)
    ]
    header = ("method", "photons", "rank", "mean", "minus that of the best", "p", "least p possible", unit)
    return text_table(rows, header)

"""The measures of an evaluation, their means with intervals, and comparisons of methods.

All are of `Evaluation.frame` (see `pcii.evaluation.rows`). Datasets that differ in seed and amount of light
alone are one scene. Yardsticks look at no photon.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from pcii.base import InputError
from pcii.depth import FOR_COUNTS
from pcii.evaluation.method_names import depth_name
from pcii.evaluation.rows import HEAD
from pcii.figures import PLACES

if TYPE_CHECKING:
    from pandas import DataFrame, Series

Kind = Literal["signed", "share", "positive", "geometric"]
Over = Literal["scenes", "datasets"]
CONFIDENCE = 0.95
MAX_EXACT_PAIRS = 14
"""Largest number of pairs of which all assignments of signs are computed: 2^14 means take milliseconds."""
RANDOM_FLIPS = 10_000
"""Random assignments of signs for more pairs."""
MIN_SCENES = 2
"""One scene has no spread over scenes."""
CELL = ("scene", "light", "method")


class Measure(NamedTuple):
    """A measure, its column in tables of removal, of depth or of both, and what its mean's interval is like.

    Methods are compared by those that have an `axis`, its label, in charts and on the benchmark's page, and
    ranked by those of which more is better.
    """

    name: str
    column: str = ""
    of: Literal["removal", "depth", "both", "no table"] = "no table"
    axis: str = ""
    more_is_better: bool = False
    kind: Kind = "share"


MEASURES = (
    Measure("iou", "IoU", "removal", "IoU, mean over planes with objects", True),
    Measure("pixel_iou", "IoU, pixels", "removal", "IoU with the points in focus, mean over planes", True),
    Measure("boundary_f", "boundary F", "removal"),
    Measure("false_share", "claimed falsely", "removal", "share of the film claimed falsely"),
    Measure("photon_precision", "photon precision", "removal"),
    Measure("photon_recall", "photon recall", "removal"),
    Measure("within_1px", "within 1 px", "depth", "share of depths within 1 px", True),
    Measure("within_3px", "within 3 px", "depth", "share of depths within 3 px", True),
    Measure("coverage", "answered", "depth"),
    Measure("quadratic_score", "quadratic score", "depth", "quadratic score of confidence", True, "signed"),
    Measure("brier", "Brier", "depth"),
    Measure(
        "median_px", "median, px", "depth", "median error of depth, px of total disparity", False, "positive"
    ),
    Measure("bound_px", "bound, px", "depth", kind="positive"),
    Measure("bias_px", "bias, px", "depth", kind="signed"),
    Measure("hci_objects.badpix_007", "BadPix(0.07)", "depth"),
    Measure("hci.badpix_007", "BadPix(0.07), all pixels", "depth"),
    Measure("ece", "ECE", "depth"),
    Measure("seconds", "seconds", "both", kind="positive"),
    Measure("bias_mm", kind="signed"),
    *map(Measure, ("precision", "recall", "f1", "claimed_share", "bad_1px", "bad_3px")),
    *map(Measure, ("share", "confidence", "correct")),
)
"""In the order of their columns. The interval of a measure that is not among them is "positive"."""
KINDS: dict[str, Kind] = {measure.name.rpartition(".")[2]: measure.kind for measure in MEASURES}
AXES = {measure.name: measure.axis for measure in MEASURES if measure.axis}
"""Labels of the measures that are drawn."""
MORE_IS_BETTER = [measure.name for measure in MEASURES if measure.more_is_better]
DECISIVE = {"iou": "IoU", "within_1px": "Share of depths within 1 px"}
"""What methods of removal and of depth are compared by above all, and its title."""
NOTHING = "(nothing)"
YARDSTICKS = {"everything": "(everything)", "one_depth": "(one depth)"}
"""Prefixes of columns with the scores of a yardstick, which looks at no photon, and its name among methods.

One claims everything at every plane, the other answers the one depth that is right for most pixels; `NOTHING`
claims nothing and answers nowhere."""
LOOK_AT_NO_PHOTON = (NOTHING, *YARDSTICKS.values())
"""Names in parentheses, which no method has: see `method_names.check_name`."""
SWEEPS = (*(name for name in FOR_COUNTS if "sweep" in name), "sweep-9", "sweep-33")
"""Plane sweeps, and two that no longer ship, which rows of the benchmark are of."""
SIMPLE = (*LOOK_AT_NO_PHOTON, *map(depth_name, SWEEPS))
"""What any method should beat."""


class Mean(NamedTuple):
    """Mean of `n` values and the ends of its 95 % interval, NaN for one value."""

    n: int
    mean: float
    low: float
    high: float


def mean_interval(values: Sequence[float], kind: Kind = "signed") -> Mean:
    """Mean of values and its 95 % interval by Student's t.

    Assumes independent, approximately normal values, as means of shares far from 0 and 1 are. That of a
    "share" is clipped to [0, 1]. Of "positive" values, such as times and errors, it is Student's interval of
    the logarithm of the mean, whose standard error is about s / (mean sqrt(n)): from mean / r to mean r,
    r = exp(t s / (mean sqrt(n))). So it never reaches 0, approaches the other one for values close together,
    and is longer above than below if a few large values dominate. "geometric" is the geometric mean of values
    above 0, with Student's interval of the mean of logarithms. Raises `InputError` for no values, and for
    numbers that are not finite or below 0 where they cannot be.

    >>> mean = mean_interval([0.8, 0.9, 1.0], "share")
    >>> round(mean.low, 3), round(mean.mean, 3), round(mean.high, 3)
    (0.652, 0.9, 1.0)
    """
    x = np.asarray(values, dtype=np.float64)
    if x.ndim != 1 or x.size == 0 or not np.isfinite(x).all():
        raise InputError("values: expected a list of at least one finite number")
    if kind == "positive" and x.min() < 0:
        raise InputError("values: expected numbers of at least 0")
    mean, low, high = (float(end) for end in _intervals(x, kind))
    return Mean(x.size, mean, low, high)


def _intervals(x: np.ndarray, kind: Kind) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Means over the last axis and the ends of their intervals."""
    from scipy import stats  # half a second

    if kind == "geometric":
        mean, low, high = _intervals(np.log(x), "signed")
        return np.exp(mean), np.exp(low), np.exp(high)
    n, mean = x.shape[-1], x.mean(axis=-1)
    if n == 1:
        return mean, np.full_like(mean, np.nan), np.full_like(mean, np.nan)
    half = stats.t.ppf((1 + CONFIDENCE) / 2, n - 1) * x.std(axis=-1, ddof=1) / np.sqrt(n)
    if kind == "positive":
        ratio = np.exp(np.divide(half, mean, out=np.zeros_like(mean), where=half > 0))
        return mean, mean / ratio, mean * ratio
    low, high = mean - half, mean + half
    return (mean, np.maximum(low, 0.0), np.minimum(high, 1.0)) if kind == "share" else (mean, low, high)


def sign_flip_p(differences: np.ndarray) -> tuple[np.ndarray, float]:
    """Two-sided p of a sign-flip test for each row of `differences`, and the smallest p that is possible.

    If neither of two methods is better, both signs of each difference are equally likely: p is the share of
    assignments of signs whose mean is at least as far from 0 as the observed one. It is of all 2^n up to
    n = `MAX_EXACT_PAIRS`, else of `RANDOM_FLIPS` random ones and the observed one.
    """
    from scipy import stats

    n = differences.shape[-1]
    if n == 1:
        return np.ones(differences.shape[:-1]), 1.0
    is_exact = n <= MAX_EXACT_PAIRS
    test = stats.permutation_test(
        (differences,),
        np.mean,
        permutation_type="samples",
        vectorized=True,
        n_resamples=2**n if is_exact else RANDOM_FLIPS,
        batch=1000,
        axis=-1,
        rng=0,
    )
    return np.asarray(test.pvalue), 2 / 2**n if is_exact else 2 / (1 + RANDOM_FLIPS)


def means(frame: "DataFrame", by: Sequence[str] = CELL) -> "DataFrame":
    """Mean of every measure over datasets, each the mean over its planes that have it.

    Columns: those of `by`, then `measure`, `n`, `mean`, and the interval from `low` to `high`.
    """
    import pandas as pd

    keys = [*by, "seed", "identity"]
    measures = [column for column in frame.columns if column not in HEAD]
    values = frame[[*keys, *measures]].groupby(keys, observed=True, dropna=False).mean()
    parts = [
        _group_means(values[measure], by, kind_of(measure), measure)
        for measure in measures
        if values[measure].notna().any()
    ]
    return pd.concat(parts, ignore_index=True)


def means_over_scenes(cell_means: "DataFrame", kinds: Mapping[str, Kind]) -> "DataFrame":
    """Means over scenes of the means of `means`, by light and method, with the same columns.

    Intervals are of the spread between scenes. `kinds` are those of measures that do not have `kind_of`.
    """
    import pandas as pd

    by = ["light", "method"]
    values = cell_means.set_index([*by, "scene"]).sort_index()
    parts = [
        _group_means(cells["mean"], by, kinds.get(str(measure), kind_of(str(measure))), str(measure))
        for measure, cells in values.groupby("measure", sort=False)
    ]
    return pd.concat(parts, ignore_index=True)


def _group_means(values: "Series", by: Sequence[str], kind: Kind, measure: str) -> "DataFrame":
    """Means of sorted values by group: groups of one size are the rows of one array."""
    values = values.dropna()
    sizes = values.groupby(level=list(by), observed=True, dropna=False).size()
    table = sizes.reset_index(name="n")
    ends = np.full((len(table), 3), np.nan)
    for n in np.unique(table["n"]):
        is_of_size = (table["n"] == n).to_numpy()
        rows = values.to_numpy()[np.repeat(is_of_size, table["n"])].reshape(-1, n)
        ends[is_of_size] = np.stack(_intervals(rows, kind), axis=-1)
    table.insert(len(by), "measure", measure)
    return table.assign(mean=ends[:, 0], low=ends[:, 1], high=ends[:, 2])


def over_scenes(cell_means: "DataFrame") -> "DataFrame":
    """Means by light and method from those of `means`: over scenes, and of one scene over its datasets."""
    return cell_means if cell_means["scene"].nunique() < MIN_SCENES else means_over_scenes(cell_means, {})


def ranked_over(frame: "DataFrame", measure: str) -> Over:
    """What methods are ranked over by default: scenes, or the datasets of a single scene."""
    scenes = frame["scene"][frame[measure].notna()].nunique() if measure in frame else 0
    return "datasets" if scenes < MIN_SCENES else "scenes"


def ranks(frame: "DataFrame", measure: str, over: Over | None = None) -> "DataFrame":
    """Methods at each light by their mean over scenes, the best first, on the datasets that all have.

    Each scene counts once, as the mean over its seeds: further seeds say more about the same scene, and only
    other scenes say how far a result holds. With `over` = "datasets" each dataset counts, as for one scene
    without it. A light of one scene has no ranks over scenes.
    Columns: `light`, `method`, `rank` (equal methods share one), `n` scenes (or datasets), `mean` with its
    interval from `low` to `high`; of the difference to the best method on the same scenes `difference`,
    `difference_low`, `difference_high`, `p` (see `sign_flip_p`) and `least_p`. Raises `InputError` for a
    measure that is not among `MORE_IS_BETTER`, for another `over`, and for ranks of one scene over scenes.
    """
    import pandas as pd

    if measure not in MORE_IS_BETTER:
        raise InputError(f"measure: methods are ranked by {', '.join(MORE_IS_BETTER)}, got {measure!r}")
    possible = ranked_over(frame, measure)
    if over not in (None, "scenes", "datasets"):
        raise InputError(f"over: expected 'scenes' or 'datasets', got {over!r}")
    if over == "scenes" and possible == "datasets":
        raise InputError("over: one scene has no spread over scenes; use over='datasets'")
    key = "scene" if (over or possible) == "scenes" else "identity"
    tables = [pd.DataFrame(columns=["light", "method"])]
    has_measure = frame[frame[measure].notna()] if measure in frame else frame[:0]
    for light, at_light in has_measure.groupby("light", observed=True):
        keys = list(dict.fromkeys([key, "seed", "identity"]))
        values = at_light.pivot_table(measure, keys, "method", observed=True, dropna=False, sort=True)
        values = values.dropna().groupby(level=key, observed=True).mean()
        if not len(values) or (key == "scene" and len(values) < MIN_SCENES):
            continue
        x = values.to_numpy().T.copy()
        score = x.mean(axis=-1)
        order = np.argsort(-score, kind="stable")
        x = x[order]
        table = pd.DataFrame({"light": light, "method": values.columns[order]})
        table["rank"] = [1 + int((score > mean).sum()) for mean in score[order]]
        table["n"] = x.shape[1]
        table[["mean", "low", "high"]] = np.stack(_intervals(x, kind_of(measure)), axis=-1)
        ends = ["difference", "difference_low", "difference_high"]
        table[ends] = np.stack(_intervals(x - x[0], "signed"), axis=-1)
        table["p"], table["least_p"] = sign_flip_p(x - x[0])
        table.loc[0, [*ends, "p", "least_p"]] = np.nan
        tables.append(table)
    return pd.concat(tables[1:] or tables, ignore_index=True)


def kind_of(measure: str) -> Kind:
    """What interval the mean of a measure has."""
    return KINDS.get(measure.removeprefix("pixel_").rpartition(".")[2], "positive")


def with_yardsticks(frame: "DataFrame") -> "DataFrame":
    """The frame with rows of `YARDSTICKS` and `NOTHING`, in place of the columns with their scores."""
    import pandas as pd

    keys = [name for name in HEAD if name != "method"] + ["photons_per_view"]
    names = {
        prefix: {name: name.replace(f"{prefix}.", "") for name in map(str, frame) if f"{prefix}." in name}
        for prefix in YARDSTICKS
    }
    parts = [frame.drop(columns=[name for measures in names.values() for name in measures])]
    for prefix, measures in names.items():
        scores = frame[[*keys, *measures]].dropna(how="all", subset=[*measures])
        scores = scores.drop_duplicates(["identity", "light", "recipe", "z_mm"]).rename(columns=measures)
        nothing = scores.assign(method=NOTHING)
        nothing[[*measures.values()]] *= 0.0
        parts += [scores.assign(method=YARDSTICKS[prefix]), nothing]
    return pd.concat([part for part in parts if len(part)] or parts[:1], ignore_index=True)


def accuracies(table: "DataFrame", measure: str) -> "DataFrame":
    """The means of a measure by method and light, with those of photons per view and of seconds."""
    cells = table[table["measure"] == measure].set_index(["method", "light"])[["n", "mean", "low", "high"]]
    cells = cells.assign(**{end: cells[end].fillna(cells["mean"]) for end in ("low", "high")})
    for name in PLACES:
        places = table[table["measure"] == name].set_index(["method", "light"])["mean"]
        cells[name] = places.reindex(cells.index)
    return cells.reset_index()

"""What an evaluation measures: names, what is better, intervals; and yardsticks, which look at no photon."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from pcii.depth import FOR_COUNTS
from pcii.evaluation.method_names import depth_name
from pcii.evaluation.rows import HEAD

if TYPE_CHECKING:
    from pandas import DataFrame

Kind = Literal["signed", "share", "positive", "geometric"]


@dataclass(frozen=True)
class Measure:
    """A measure in tables of removal, of depth or of both.

    Methods are compared by those that have an `axis`, its label, in charts and on the benchmark's page, and
    ranked by those of which more is better.
    """

    name: str
    column: str
    of: Literal["removal", "depth", "both"]
    axis: str = ""
    more_is_better: bool = False


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
    Measure("quadratic_score", "quadratic score", "depth", "quadratic score of confidence", True),
    Measure("brier", "Brier", "depth"),
    Measure("median_px", "median, px", "depth", "median error of depth, px of total disparity"),
    Measure("bound_px", "bound, px", "depth"),
    Measure("bias_px", "bias, px", "depth"),
    Measure("hci_objects.badpix_007", "BadPix(0.07)", "depth"),
    Measure("hci.badpix_007", "BadPix(0.07), all pixels", "depth"),
    Measure("ece", "ECE", "depth"),
    Measure("seconds", "seconds", "both"),
)
"""In the order of their columns."""
AXES = {measure.name: measure.axis for measure in MEASURES if measure.axis}
MORE_IS_BETTER = [measure.name for measure in MEASURES if measure.more_is_better]
DECISIVE = {"iou": "IoU", "within_1px": "Share of depths within 1 px"}
"""What methods of removal and of depth are compared by above all, and its title."""
SHARES = {"iou", "precision", "recall", "f1", "boundary_f", "photon_precision", "photon_recall"}
SHARES |= {"claimed_share", "false_share", "within_1px", "within_3px", "bad_1px", "bad_3px", "coverage"}
SHARES |= {"badpix_007", "brier", "ece", "share", "confidence", "correct"}
SIGNED = {"bias_mm", "bias_px", "quadratic_score"}
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


def kind_of(measure: str) -> Kind:
    """What interval the mean of a measure has."""
    name = measure.removeprefix("pixel_").rpartition(".")[2]
    return "share" if name in SHARES else "signed" if name in SIGNED else "positive"


def with_yardsticks(frame: "DataFrame") -> "DataFrame":
    """The frame with rows of `YARDSTICKS` and `NOTHING`, in place of the columns with their scores."""
    import pandas as pd

    keys = [name for name in HEAD if name != "method"] + ["photons_per_view"]
    names = {
        prefix: {name: name.replace(f"{prefix}.", "") for name in frame if f"{prefix}." in str(name)}
        for prefix in YARDSTICKS
    }
    parts = [frame.drop(columns=[name for measures in names.values() for name in measures])]
    for prefix, measures in names.items():
        scores = frame[[*keys, *measures]].dropna(how="all", subset=[*measures])
        scores = scores.drop_duplicates(["identity", "light", "z_mm"]).rename(columns=measures)
        nothing = scores.assign(method=NOTHING)
        nothing[[*measures.values()]] *= 0.0
        parts += [scores.assign(method=YARDSTICKS[prefix]), nothing]
    return pd.concat([part for part in parts if len(part)] or parts[:1], ignore_index=True)

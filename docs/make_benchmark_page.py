"""Write the page of the methods that ship, docs/experiments/removal_scores.md and its picture.

`python docs/make_benchmark_page.py SUBMISSIONS MACHINE`: SUBMISSIONS is the folder of what `pcii benchmark
run` wrote on the test half of the benchmark; MACHINE is a few words on where it ran, since there are times.
"""

import itertools
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import matplotlib
import pandas as pd

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from pcii.evaluation.benchmark_page import write_page
from pcii.evaluation.benchmark_scores import by_scene
from pcii.evaluation.frames import frame_of
from pcii.evaluation.rows import read_rows
from pcii.evaluation.submissions import SUBMISSION
from pcii.evaluation.summary import lines_of, means, with_yardsticks
from pcii.evaluation.tables import with_interval
from pcii.figures.charts import quiet_grid
from pcii.figures.panels import COLOURS, MARKERS
from pcii.store.collection import IN_FRAMES
from simgen.dataset.benchmark_making import load_definition

BENCHMARK = "pcii-bench-1"
DOCS = Path(__file__).parent
METHOD = "posterior"
PAGE = """# Scores of removal, kind by kind

The methods of removal that ship, on the test half of [the benchmark](../benchmark.md). [Its page](../{page})
has the scores of each scene with their intervals, and depth. Made by `docs/make_benchmark_page.py`;
times are of {machine}.

[Removal of defocused points](../removal.md) describes the methods; [the three steps](three_step.md) show what
limits them.

![IoU against photons and against time](removal_scores.jpg)

*Mean IoU with the objects of each plane over the scenes of a kind that hold any, each the mean of its draws
of photons, at {lights} photons per view. What leans belongs to no one plane: it counts
by pixel and in depth.*

## Where the network's IoU falls with more photons

By more than {fall:g} in the mean over draws; in brackets the 95 % interval, where there are several:

{falls}
"""
FALL = 0.02


def main(submissions: Path, machine: str) -> None:
    """Write the pages and the picture into docs/."""
    page = f"{BENCHMARK}.html"
    write_page(submissions, DOCS / page)
    kinds = {scene.name: scene.kind for scene in load_definition(BENCHMARK)[0].scene}
    table = results(submissions)
    found = "\n".join(falls(table)) or "- nowhere"
    lights = ", ".join(f"{light:g}" for light in sorted(table["light"][table["measure"] == "iou"].unique()))
    text = PAGE.format(page=page, machine=machine, falls=found, fall=FALL, lights=lights)
    (DOCS / "experiments" / "removal_scores.md").write_text(text, encoding="utf-8")
    draw(table, kinds, DOCS / "experiments" / "removal_scores.jpg")


def results(submissions: Path) -> pd.DataFrame:
    """Means over draws of what was measured of removal, without binary frames: see `summary.means`."""
    rows = [row for file in sorted(submissions.glob(f"*/{SUBMISSION}")) for row in read_rows(file.parent)]
    table = means(with_yardsticks(frame_of(by_scene(rows))))
    methods = table["method"][table["measure"] == "iou"].unique()
    return table[table["method"].isin(methods) & ~table["scene"].astype(str).str.endswith(IN_FRAMES)]


def falls(table: pd.DataFrame) -> Iterator[str]:
    """A line for each fall of the network's IoU to the next larger budget."""
    own = table[(table["method"] == METHOD) & (table["measure"] == "iou")]
    for scene, rows in own.groupby("scene", observed=True):
        for before, after in itertools.pairwise(lines_of(rows.sort_values("light"))):
            if before.mean - after.mean > FALL:
                ends = " to ".join(with_interval(row.mean, row.low, row.high, 2) for row in (before, after))
                yield f"- `{scene}`: {ends} at {after.light:g}"


def draw(table: pd.DataFrame, kinds: Mapping[str, str], file: Path) -> None:
    """Mean IoU of each kind against photons (above) and against seconds (below)."""
    values = table.pivot(index=["scene", "method", "light"], columns="measure", values="mean").reset_index()
    values = values.dropna(subset="iou")
    values["kind"] = [kinds[scene] for scene in values["scene"]]
    shown = [kind for kind in dict.fromkeys(kinds.values()) if kind in set(values["kind"])]
    figure, axes = plt.subplots(2, len(shown), figsize=(14, 5.6), sharey=True, layout="constrained")
    for column, kind in enumerate(shown):
        of_kind = values[values["kind"] == kind].groupby(["method", "light"], observed=True)
        of_methods = of_kind[["iou", "seconds"]].mean().groupby(level="method")
        for number, (method, own) in enumerate(of_methods):
            style = {"color": COLOURS[number], "marker": MARKERS[number], "markersize": 4, "linewidth": 1.3}
            axes[0, column].plot(
                own.index.get_level_values("light").to_list(), own["iou"], label=method, **style
            )
            axes[1, column].plot(own["seconds"], own["iou"], linestyle="none", **style)
        axes[0, column].set(title=kind, xlabel="photons per view")
        axes[1, column].set(xlabel="seconds")
    for axis in axes.flat:
        axis.set(xscale="log", ylim=(-0.02, 1.02))
        quiet_grid(axis)
    for axis in axes[:, 0]:
        axis.set_ylabel("IoU")
    handles, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(names), frameon=False)
    figure.savefig(file, dpi=90, pil_kwargs={"quality": 80})


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])

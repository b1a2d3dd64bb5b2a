"""Write the page of the methods that ship, docs/experiments/removal_scores.md and its picture.

`python docs/make_benchmark_page.py SUBMISSIONS MACHINE`: SUBMISSIONS is the folder of what `pcii benchmark
run` wrote on the test half of the benchmark; MACHINE is a few words on where it ran, since there are times.
"""

import itertools
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from pcii.evaluation.benchmark_page import write_page
from pcii.evaluation.submission_checks import SUBMISSION
from pcii.evaluation.tables import with_interval
from pcii.figures.charts import few_ticks, quiet_grid
from pcii.figures.panels import COLOURS, MARKERS
from pcii.store.collection import IN_FRAMES
from pcii.store.folders import read_evaluation
from simgen.dataset.benchmark_making import load_definition

BENCHMARK = "pcii-bench-1"
DOCS = Path(__file__).parent
METHOD = "likelihood"
PAGE = """# Scores of removal, kind by kind

The methods of removal that ship, on the test half of [the benchmark](../benchmark.md). [Its page](../{page})
has the scores of each scene with their intervals, and depth. Made by `docs/make_benchmark_page.py`;
times are of {machine}.

[Removal of defocused points](../removal.md) describes the methods; [the likelihood method](likelihood.md) and
[the three steps](three_step.md) show what limits them.

![IoU against photons and against time](removal_scores.jpg)

*Mean IoU with the objects of each plane over the scenes of a kind, each the mean of its draws of photons.
What leans or is a wall belongs to no one plane: there even the oracle's masks have 0.04 to 0.51, and depth
tells more.*

## Where the likelihood method's IoU falls with more photons

By more than {fall:g} in the mean over draws; in brackets the 95 % interval, wide where there are three draws:

{falls}
"""
FALL = 0.02
Results = dict[str, list[Mapping[str, Any]]]


def main(submissions: Path, machine: str) -> None:
    """Write the pages and the picture into docs/."""
    page = f"{BENCHMARK}.html"
    write_page(submissions, DOCS / page)
    kinds = {scene.name: scene.kind for scene in load_definition(BENCHMARK)[0].scene}
    of_scene = results(submissions)
    found = "\n".join(falls(of_scene)) or "- nowhere"
    text = PAGE.format(page=page, machine=machine, falls=found, fall=FALL)
    (DOCS / "experiments" / "removal_scores.md").write_text(text, encoding="utf-8")
    draw(of_scene, kinds, DOCS / "experiments" / "removal_scores.jpg")


def results(submissions: Path) -> Results:
    """What was measured of removal by scene, in order of photons; without binary frames."""
    found = defaultdict[str, list[Mapping[str, Any]]](list)
    for file in sorted(submissions.glob(f"*/{SUBMISSION}")):
        for group in read_evaluation(file.parent)["groups"]:
            rows = [row for row in group["results"] if row.get("object", {}).get("iou")]
            if rows and not group["title"].endswith(IN_FRAMES):
                found[group["title"]] += sorted(rows, key=lambda row: row["budget"])
    return found


def falls(of_scene: Results) -> Iterator[str]:
    """A line for each fall of the likelihood method's IoU to the next larger budget."""
    for scene, rows in of_scene.items():
        ious = [(row["budget"], row["object"]["iou"]) for row in rows if row["method"] == METHOD]
        for (_, before), (budget, after) in itertools.pairwise(ious):
            if before["mean"] - after["mean"] > FALL:
                ends = f"{with_interval(before, 2)} to {with_interval(after, 2)}"
                yield f"- `{scene}`: {ends} at {budget:g}"


def draw(of_scene: Results, kinds: Mapping[str, str], file: Path) -> None:
    """Mean IoU of each kind against photons (above) and against seconds (below)."""
    shown = [
        kind for kind in dict.fromkeys(kinds.values()) if any(kinds[scene] == kind for scene in of_scene)
    ]
    figure, axes = plt.subplots(2, len(shown), figsize=(14, 5.6), sharey=True, layout="constrained")
    for column, kind in enumerate(shown):
        own = defaultdict[str, dict[float, list[tuple[float, float]]]](lambda: defaultdict(list))
        for scene, rows in of_scene.items():
            for row in rows if kinds[scene] == kind else ():
                pair = row["object"]["iou"]["mean"], row["seconds"]["mean"]
                own[row["method"]][row["budget"]].append(pair)
        for number, (method, by_budget) in enumerate(sorted(own.items())):
            iou, seconds = np.array([np.mean(pairs, axis=0) for pairs in by_budget.values()]).T
            style = {"color": COLOURS[number], "marker": MARKERS[number], "markersize": 4, "linewidth": 1.3}
            axes[0, column].plot(list(by_budget), iou, label=method, **style)
            axes[1, column].plot(seconds, iou, **style)
        axes[0, column].set(title=kind, xlabel="photons per view")
        axes[1, column].set(xlabel="seconds")
    for axis in axes.flat:
        axis.set(xscale="log", ylim=(-0.02, 1.02))
        quiet_grid(axis)
    for axis in axes[1]:
        few_ticks(axis.xaxis)
    for axis in axes[:, 0]:
        axis.set_ylabel("IoU")
    handles, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(names), frameon=False)
    figure.savefig(file, dpi=90, pil_kwargs={"quality": 80})


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])

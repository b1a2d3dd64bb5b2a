"""Write docs/experiments/removal_scores.md and its picture from an evaluation.

`python docs/make_removal_scores.py EVALUATION MACHINE`: EVALUATION is scores/evaluation.json of what
`BENCH_SEEDS=1 make bench TABLES=removal` leaves in out/benchmark; MACHINE is a few words on where it ran,
since the page has times.
"""

import json
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.ticker import LogLocator, NullLocator

from benchmarks.corpus import Entry, load_corpus
from pcii.evaluation.method_names import DEPTH, full_name
from pcii.evaluation.tables import Table, markdown
from pcii.figures.palette import COLOURS, MARKERS

Group = Mapping[str, Any]
KINDS = ("paper", "textured", "untextured", "cluttered")
FALL = 0.02
"""A fall of IoU from one budget to the next that is worth a line, where there is but one seed."""
PAGE = """# Scores of removal, scene by scene

Made by `docs/make_removal_scores.py` from one seed of each scene of the benchmark; all methods see the same
photons.

```
BENCH_SEEDS=1 make bench TABLES=removal     # an hour and a half on two cores, shared by BENCH_WORKERS
```

[Removal of defocused points](../removal.md) describes the methods; [the likelihood method](likelihood.md) and
[the three steps](three_step.md) have figures of many seeds, with their intervals. With one seed a difference
of 0.02 may be chance, and one of 0.1 or more where objects touch or hide one another. 300 000 photons per
view, 0.3 per pixel, stand for full light.

![IoU against photons and against time](removal_scores.jpg)

*Mean over the scenes of a kind, both halves of the corpus.*

## IoU

By object, mean over the planes, by photons per view; the best method in bold. *Oracle*: masks from the true
depth of each pixel.

{scores}

## Accuracy against time

Mean IoU over the scenes that have objects, and mean seconds ({machine}).

{times}

## Depth of slanted surfaces

Depth maps (`pcii.estimate_depth`): median error in px of total disparity, the share of the surface
that is answered, and seconds.

{depths}

## Where the likelihood method's IoU falls with more photons

By more than {fall:g} from one budget to the next:

{falls}
"""


def main(evaluation: Path, machine: str) -> None:
    """Write the page and the picture into the folder of experiments."""
    entries = {entry.name: entry for entry in load_corpus()}
    groups = [group for group in json.loads(evaluation.read_text())["groups"] if group["title"] in entries]
    groups.sort(key=lambda group: list(entries).index(group["title"]))
    slanted = [group for group in groups if entries[group["title"]].kind == "depth"]
    flat = [group for group in groups if group not in slanted]
    full = [group for group in flat if entries[group["title"]].kind != "empty"]
    page = PAGE.format(
        scores=markdown(scores(flat, entries)),
        times=markdown(times(full)),
        depths=markdown(depths(slanted)),
        falls="\n".join(falls(full)),
        machine=machine,
        fall=FALL,
    )
    folder = Path(__file__).with_name("experiments")
    (folder / "removal_scores.md").write_text(page)
    draw(full, entries, folder / "removal_scores.jpg")


def measured(group: Group) -> Iterator[tuple[str, float, float, float]]:
    """Method, budget, mean object IoU and seconds of all that has an IoU, by method."""
    for row in sorted(group["results"], key=lambda row: (row["method"], row["budget"])):
        iou = row.get("object", {}).get("iou")
        if iou:
            yield row["method"], row["budget"], iou["mean"], row["seconds"]["mean"]


def budgets_of(groups: list[Group]) -> list[float]:
    """All photon budgets, ascending."""
    return sorted({budget for group in groups for _, budget, _, _ in measured(group)})


def scores(groups: list[Group], entries: Mapping[str, Entry]) -> Table:
    """IoU of every scene and method by photons per view."""
    budgets, rows = budgets_of(groups), []
    for group in groups:
        entry, ious = entries[group["title"]], defaultdict[str, dict[float, float]](dict)
        for method, budget, iou, _ in measured(group):
            ious[method][budget] = iou
        best = {budget: max(own.get(budget, -1.0) for own in ious.values()) for budget in budgets if ious}
        for number, (method, own) in enumerate(ious.items()):
            name = (entry.name, entry.half, entry.kind) if number == 0 else ("", "", "")
            cells = [f"{own[budget]:.2f}" if budget in own else "–" for budget in budgets]
            for place, budget in enumerate(budgets):
                if budget in own and cells[place] == f"{best[budget]:.2f}":
                    cells[place] = f"**{cells[place]}**"
            rows.append((*name, method, *cells))
        oracle = [row["object"]["iou_oracle"] for row in group["results"] if "object" in row]
        if ious and oracle[0]:
            rows.append(("", "", "", "oracle", *[f"{oracle[0]['mean']:.2f}"] * len(budgets)))
    header = ("scene", "half", "kind", "method", *(f"{budget:g}" for budget in budgets))
    return Table("", header, tuple(rows), words=4)


def mean_scores(groups: list[Group]) -> dict[str, np.ndarray]:
    """Photons per view, mean IoU and mean seconds (3, B) of each method over all scenes."""
    found = defaultdict[str, dict[float, list[tuple[float, float]]]](lambda: defaultdict(list))
    for group in groups:
        for method, budget, iou, seconds in measured(group):
            found[method][budget].append((iou, seconds))
    return {
        method: np.array([(budget, *np.mean(own[budget], axis=0)) for budget in sorted(own)]).T
        for method, own in sorted(found.items())
    }


def times(groups: list[Group]) -> Table:
    """Mean IoU and seconds over all scenes, by method and photons per view."""
    rows = [
        (method, *(f"{iou:.2f}, {seconds:.1f} s" for _, iou, seconds in means.T))
        for method, means in mean_scores(groups).items()
    ]
    return Table("", ("method", *(f"{budget:g}" for budget in budgets_of(groups))), tuple(rows))


def depths(groups: list[Group]) -> Table:
    """Depth maps of the default method by photons per view."""
    default = full_name(DEPTH, full_light=False)
    found = {
        group["title"]: {row["budget"]: _depth(row) for row in group["results"] if row["method"] == default}
        for group in groups
    }
    budgets = sorted({budget for own in found.values() for budget in own})
    rows = [(title, *(own.get(budget, "–") for budget in budgets)) for title, own in found.items()]
    return Table("", ("scene", *(f"{budget:g}" for budget in budgets)), tuple(rows))


def _depth(row: Mapping[str, Any]) -> str:
    median, answered = (row["depth"].get(name) for name in ("median_px", "coverage"))
    error = "–" if median is None else f"{median['mean']:.1f} px"
    share = "–" if answered is None else f"{100 * answered['mean']:.0f} %"
    return f"{error}, {share}, {row['seconds']['mean']:.1f} s"


def falls(groups: list[Group]) -> Iterator[str]:
    """A line for each fall of the likelihood method's IoU to the next larger budget."""
    for group in groups:
        before = 0.0
        for method, budget, iou, _ in measured(group):
            if method == "likelihood":
                if iou < before - FALL:
                    yield f"- `{group['title']}`: {before:.2f} to {iou:.2f} at {budget:g}"
                before = iou


def draw(groups: list[Group], entries: Mapping[str, Entry], file: Path) -> None:
    """Mean IoU of each kind against photons (above) and against seconds (below)."""
    figure, axes = plt.subplots(2, len(KINDS), figsize=(12, 5.6), sharey=True, layout="constrained")
    for column, kind in enumerate(KINDS):
        own = [group for group in groups if entries[group["title"]].kind == kind]
        for number, (method, (budgets, iou, seconds)) in enumerate(mean_scores(own).items()):
            style = {"color": COLOURS[number], "marker": MARKERS[number], "markersize": 4, "linewidth": 1.3}
            axes[0, column].plot(budgets, iou, label=method, **style)
            axes[1, column].plot(seconds, iou, **style)
        axes[0, column].set(title=kind, xlabel="photons per view")
        axes[1, column].set(xlabel="seconds")
    for axis in axes.flat:
        axis.set(xscale="log", ylim=(-0.02, 1.02))
        axis.grid(True, color="#d9dde5", linewidth=0.6)
        axis.spines[["top", "right"]].set_visible(False)
    for axis in axes[1]:
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axis.xaxis.set_minor_locator(NullLocator())
    for axis in axes[:, 0]:
        axis.set_ylabel("IoU")
    handles, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(names), frameon=False)
    figure.savefig(file, dpi=100, pil_kwargs={"quality": 80})


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])

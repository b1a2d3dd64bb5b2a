"""Draw docs/experiments/removal_scores.jpg, IoU of the methods that ship against photons and against time.

`python docs/make_removal_scores.py SUBMISSIONS`: the folder of what `pcii benchmark run` wrote on the test
half of the benchmark.
"""

import sys
from pathlib import Path

import matplotlib
import pandas as pd

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from pcii.evaluation import SUBMISSION, frame_of, means, read_rows
from pcii.evaluation.rows import by_scene
from pcii.evaluation.summary import with_yardsticks
from pcii.figures.charts import COLOURS, MARKERS, quiet_grid
from pcii.store import IN_FRAMES
from simgen.dataset import load_definition


def results(submissions: Path) -> pd.DataFrame:
    """Means over draws of what was measured of removal: a row a scene, method and light."""
    rows = [row for file in sorted(submissions.glob(f"*/{SUBMISSION}")) for row in read_rows(file.parent)]
    table = means(with_yardsticks(frame_of(by_scene(rows))))
    table = table[~table["scene"].astype(str).str.endswith(IN_FRAMES)]
    values = table.pivot(index=["scene", "method", "light"], columns="measure", values="mean").reset_index()
    kinds = {scene.name: scene.kind for scene in load_definition("pcii-bench-1")[0].scene}
    return values.dropna(subset="iou").assign(kind=lambda rows: rows["scene"].astype(str).map(kinds))


def draw(values: pd.DataFrame, file: Path) -> None:
    """Mean IoU of each kind against photons (above) and against seconds (below)."""
    shown = list(dict.fromkeys(values["kind"]))
    figure, axes = plt.subplots(2, len(shown), figsize=(14, 5.6), sharey=True, layout="constrained")
    for column, kind in enumerate(shown):
        of_kind = values[values["kind"] == kind].groupby(["method", "light"], observed=True)
        of_methods = of_kind[["iou", "seconds"]].mean().groupby(level="method")
        for number, (method, scores) in enumerate(of_methods):
            style = {"color": COLOURS[number], "marker": MARKERS[number], "markersize": 4, "linewidth": 1.3}
            axes[0, column].plot(
                scores.index.get_level_values("light").to_list(), scores["iou"], label=method, **style
            )
            axes[1, column].plot(scores["seconds"], scores["iou"], linestyle="none", **style)
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
    draw(results(Path(sys.argv[1])), Path(__file__).parent / "experiments" / "removal_scores.jpg")

"""The main job, from a recipe to a report: time and peak memory, beside a plain script for the same job.

Whole processes on an empty folder, in turns. The plain script (benchmarks/peers/plain_pipeline.py) takes as
many samples and draws and estimates the same things by the simplest means.
"""

import json
import shutil
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.figures import bars
from benchmarks.processes import Finished, run_process
from benchmarks.results import Measured, Row, Size, Study, Value
from benchmarks.timing import median_of, ratio_of
from simgen.spec.recipe import load_recipe

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parent.parent.parent
BIN = Path(sys.executable).parent
WHOLE = "Whole processes"
STAGES = "Stages"
OWN, PLAIN = "ours", "plain script"
ANALYSIS = """
import json, sys
from pathlib import Path
from pcii.app.results import run
from pcii.store.dataset import open_dataset
from pcii.store.suggested_depths import depth_range_of, planes_of
dataset = open_dataset(Path(sys.argv[1]))
outcome = run(dataset, Path(sys.argv[2]), planes_of(dataset, None), depth_range_of(dataset))
print(json.dumps(outcome.timings_s))
"""
"""What `pcii run` does, but for the command line; it tells the seconds of its stages."""
ASIDE = "everything else"
"""Imports, starting and stopping: what is in no stage."""


SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {"rows": 4, "side_px": 256, "repeats": 2},
    "full": {"rows": 10, "side_px": 1024, "repeats": 6},
}


def measure(rows: int, side_px: int, repeats: int) -> Measured:
    """The paper's recipe, at quick size with fewer cameras and pixels."""
    samples = load_recipe("paper")[0].render.samples_per_pixel
    totals: dict[str, list[float]] = {OWN: [], PLAIN: []}
    peaks: dict[str, list[float]] = {}
    stages: dict[tuple[str, str], list[float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(repeats):
            for name, run in ((OWN, _ours), (PLAIN, _plain)):
                out = Path(folder) / "run"
                finished, seconds = run(out, rows, side_px, samples)
                shutil.rmtree(out)
                total = sum(each.seconds for each in finished.values())
                totals[name].append(total)
                for part, each in finished.items():
                    if each.peak_mb is not None:
                        peaks.setdefault(part, []).append(each.peak_mb)
                for stage, taken in (seconds | {ASIDE: total - sum(seconds.values())}).items():
                    stages.setdefault((name, stage), []).append(taken)
    found = [Row(WHOLE, name, {}, {"time_s": _spread(taken)}) for name, taken in totals.items()]
    found += [Row("Peak memory", part, {}, {"peak_mb": Value(max(taken))}) for part, taken in peaks.items()]
    found += [
        Row(STAGES, name, {"stage": stage}, {"time_s": _spread(s)}) for (name, stage), s in stages.items()
    ]
    ratios = [ratio_of(f"{OWN} against {PLAIN}", totals[PLAIN], totals[OWN])]
    return Measured(found, ratios, [load_recipe("paper")[0].seed])


def _spread(samples: list[float]) -> Value:
    """The median, and the least and the most where there are too few runs for an interval."""
    found = median_of(samples)
    return found if found.low is not None else Value(found.value, min(samples), max(samples))


def _ours(out: Path, rows: int, side_px: int, samples: int) -> tuple[dict[str, Finished], dict[str, float]]:
    """`simgen generate` and the work of `pcii run`, with the seconds that manifest and analysis tell."""
    settings = [
        f"grid.rows={rows}", f"grid.cols={rows}", f"grid.height={side_px}", f"grid.width={side_px}",
        f"grid.pixel_mm={36.0448 / side_px}", f"grid.pitch_mm=[{45 / (rows - 1)}, {45 / (rows - 1)}]",
        f"render.samples_per_pixel={samples}",
    ]  # fmt: skip
    options = [part for setting in settings for part in ("--set", setting)]
    data, results = out / "data", out / "results"
    made = run_process([str(BIN / "simgen"), "generate", "paper", "--out", str(data), *options])
    analysed = run_process([sys.executable, "-c", ANALYSIS, str(data), str(results)])
    manifest: dict[str, Any] = json.loads((data / "manifest.json").read_text(encoding="utf-8"))
    stages = {f"data: {name}": seconds for name, seconds in manifest["timings_s"].items()}
    stages |= json.loads(analysed.output)
    return {"simgen generate": made, "pcii run": analysed}, stages


def _plain(out: Path, rows: int, side_px: int, samples: int) -> tuple[dict[str, Finished], dict[str, float]]:
    module = [sys.executable, "-m", "benchmarks.peers.plain_pipeline"]
    given = {"folder": ROOT / "scenes" / "two_objects", "rows": rows, "side-px": side_px, "samples": samples}
    options = [part for name, value in (given | {"out": out}).items() for part in (f"--{name}", str(value))]
    finished = run_process([*module, *options])
    return {PLAIN: finished}, json.loads(finished.output)


def draw(figure: "Figure", measured: Measured) -> None:
    """Seconds of each stage, ours and the plain script's."""
    panels = figure.subplots(1, 2, sharex=True)
    for axes, name in zip(panels, (OWN, PLAIN), strict=True):
        rows = [row for row in measured.of(STAGES) if row.name == name]
        stages = [str(row.parameters["stage"]) for row in rows]
        bars(axes, stages, [row.values["time_s"] for row in rows], "time, s")
        total = measured.one(WHOLE, name).values["time_s"].value
        axes.set_title(f"{name}: {total:.1f} s in all", fontsize=10)


def reading(measured: Measured) -> str:
    """How to read it: both totals, and what the plain one leaves out."""
    own, plain = (measured.one(WHOLE, name).values["time_s"].value for name in (OWN, PLAIN))
    return (
        f"What does the whole job take, from a recipe to a report with masks, depth and scores? {own:.1f} s"
        f" where a plain script takes {plain:.1f} s, {measured.ratio(f'{OWN} against {PLAIN}'):.2f} times"
        " as fast; bars are the median run, with the least and the most where runs are few. The plain"
        " script does less for its time: its counts have rendering noise, its masks are a threshold and"
        " its depth is a plane sweep by variance, nothing is checked, hashed or can be resumed, and"
        " photons do not know where they came from."
    )


STUDY = Study("end-to-end", "End to end", SIZES, measure, draw, reading, width_in=9.0, height_in=4.0)

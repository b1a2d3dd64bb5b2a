"""The main job, from a recipe to a report: time and peak memory, beside a plain script for the same job.

Whole processes on an empty folder, in turns. The plain script (benchmarks/peers/plain_pipeline.py) takes as
many samples and draws and estimates the same things by the simplest means.
"""

import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.figures import bars
from benchmarks.results import Measured, Row, Size, Study, Value
from benchmarks.scenes import film
from benchmarks.timing import median_of, ratio_of
from simgen.spec import load_recipe

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
from pcii.sections import depth_range_of, planes_of
from pcii.store import open_dataset
dataset = open_dataset(Path(sys.argv[1]))
outcome = run(dataset, Path(sys.argv[2]), planes_of(dataset, None), depth_range_of(dataset))
print(json.dumps(outcome.timings_s))
"""
"""What `pcii run` does, but for the command line; it tells the seconds of its stages."""
ASIDE = "everything else"
"""Imports, starting and stopping: what is in no stage."""
POLL_S = 0.02
"""Between two looks at the memory of a process."""


@dataclass(frozen=True)
class Finished:
    """Wall seconds, peak resident memory in MB (None where the system does not tell), standard output."""

    seconds: float
    peak_mb: float | None
    output: str


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
    results = [Row(WHOLE, name, {}, {"time_s": _spread(taken)}) for name, taken in totals.items()]
    results += [Row("Peak memory", part, {}, {"peak_mb": Value(max(mb))}) for part, mb in peaks.items()]
    results += [
        Row(STAGES, name, {"stage": stage}, {"time_s": _spread(s)}) for (name, stage), s in stages.items()
    ]
    ratios = {f"{OWN} against {PLAIN}": ratio_of(totals[PLAIN], totals[OWN])}
    return Measured(results, ratios, [load_recipe("paper")[0].seed])


def _spread(samples: list[float]) -> Value:
    """The median, and the least and the most where there are too few runs for an interval."""
    median = median_of(samples)
    return median if median.low is not None else Value(median.value, min(samples), max(samples))


def _ours(out: Path, rows: int, side_px: int, samples: int) -> tuple[dict[str, Finished], dict[str, float]]:
    """`simgen generate` and the work of `pcii run`, with the seconds that manifest and analysis tell."""
    pitch_mm = 45 / (rows - 1)
    cameras = f"grid.rows={rows}", f"grid.cols={rows}", f"grid.pitch_mm=[{pitch_mm}, {pitch_mm}]"
    settings = [*film(side_px), *cameras, f"render.samples_per_pixel={samples}"]
    options = [part for setting in settings for part in ("--set", setting)]
    data, results = out / "data", out / "results"
    generated = run_process([str(BIN / "simgen"), "generate", "paper", "--out", str(data), *options])
    analysed = run_process([sys.executable, "-c", ANALYSIS, str(data), str(results)])
    manifest: dict[str, Any] = json.loads((data / "manifest.json").read_text(encoding="utf-8"))
    stages = {f"data: {name}": seconds for name, seconds in manifest["timings_s"].items()}
    stages |= json.loads(analysed.output)
    return {"simgen generate": generated, "pcii run": analysed}, stages


def _plain(out: Path, rows: int, side_px: int, samples: int) -> tuple[dict[str, Finished], dict[str, float]]:
    module = [sys.executable, "-m", "benchmarks.peers.plain_pipeline"]
    values = {"folder": ROOT / "scenes" / "two_objects", "rows": rows, "side-px": side_px}
    values |= {"samples": samples, "out": out}
    options = [part for name, value in values.items() for part in (f"--{name}", str(value))]
    finished = run_process([*module, *options])
    return {PLAIN: finished}, json.loads(finished.output)


def run_process(command: Sequence[str]) -> Finished:
    """Run a command to its end; `CalledProcessError` with its messages if it fails.

    The peak is of the process itself. The system's count of children would not do: it hands on the peak of
    the process that started them.
    """
    start, peak = time.perf_counter(), None
    # Files, since a pipe that nobody reads stops who writes much into it.
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as messages:
        with subprocess.Popen(command, stdout=output, stderr=messages) as process:
            while process.poll() is None:
                peak = _peak_mb(process.pid) or peak
                time.sleep(POLL_S)
            seconds = time.perf_counter() - start
        output.seek(0)
        messages.seek(0)
        if process.returncode:
            fault = process.returncode, list(command), output.read(), messages.read()
            raise subprocess.CalledProcessError(*fault)
        return Finished(seconds, peak, output.read())


def _peak_mb(pid: int) -> float | None:
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return None
    return next(
        (int(line.split()[1]) / 1024 for line in status.splitlines() if line.startswith("VmHWM")), None
    )


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
    ours, plain = (measured.one(WHOLE, name).values["time_s"].value for name in (OWN, PLAIN))
    ratio = measured.ratios[f"{OWN} against {PLAIN}"].value
    return (
        f"What does the whole job take, from a recipe to a report with masks, depth and scores? {ours:.1f} s"
        f" where a plain script takes {plain:.1f} s, {ratio:.2f} times"
        " as fast; bars are the median run, with the least and the most where runs are few. The plain"
        " script does less for its time: its counts have rendering noise, its masks are a threshold and"
        " its depth is a plane sweep by variance, nothing is checked, hashed or can be resumed, and"
        " photons do not know where they came from."
    )


STUDY = Study("end-to-end", "End to end", SIZES, measure, draw, reading, width_in=9.0, height_in=4.0)

"""Scores of a simple method on a benchmark: whether photons of other bytes are as hard as the published ones.

Methods belong to `pcii`, which knows no renderer and is not known here, so its command is run.
"""

import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.io.collection_layout import Half
from pcii.io.evaluation_layout import read_evaluation

METHOD = "brightness"
"""In focus is what is bright: the simplest method of removal."""
PHOTONS_PER_VIEW = 1000.0
TOLERANCE = 0.02
"""Means that are closer say nothing: the interval of three draws may be narrow by chance."""

Scores = Mapping[str, Mapping[str, Any]]
"""By scene: `mean` IoU over seeds and its 95 % `interval`."""


def reference_scores(benchmark: Path, halves: Iterable[Half]) -> dict[str, Mapping[str, Any]]:
    """IoU of `METHOD` on each scene of these halves; `InputError` if `pcii benchmark run` fails."""
    found: dict[str, Mapping[str, Any]] = {}
    for half in halves:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "scores"
            words = ["benchmark", "run", METHOD, "--budget", f"{PHOTONS_PER_VIEW:g}", "--half", half]
            run = "import sys; from pcii.app.commands import main; sys.exit(main())"
            command = [sys.executable, "-c", run, *words, "--data", str(benchmark), "-o", str(out)]
            if subprocess.run(command, stdout=subprocess.DEVNULL).returncode:
                raise InputError(f"certificate: `pcii {' '.join(words)}` failed, as said above")
            for group in read_evaluation(out)["groups"]:
                (result,) = group["results"]
                if (iou := result["object"]["iou"]) is not None and iou["interval"] is not None:
                    found[group["title"]] = {"mean": iou["mean"], "interval": iou["interval"]}
    return found


def differing_scores(own: Scores, published: Scores) -> list[str]:
    """A sentence for each scene whose interval has nothing in common with the published one."""
    problems = []
    for scene in own.keys() & published.keys():
        (low, high), (least, most) = (scores[scene]["interval"] for scores in (own, published))
        apart = abs(own[scene]["mean"] - published[scene]["mean"])
        if (high < least or most < low) and apart > TOLERANCE:
            means = f"{own[scene]['mean']:.3f} instead of {published[scene]['mean']:.3f}"
            problems.append(f"{scene}: the method {METHOD!r} has an IoU of {means} there")
    return sorted(problems)

"""Make the network of depth and masks, going on from where it was stopped (`make train`).

    python -m training --out out --minutes 90 [--workers 16] [--anew]

First the datasets of all recipes are made: one of each, from which follows how long the others take, and then
the others. Then come examples of them, training from the weights that ship, or with --anew from random ones,
and the files that `pcii` runs. The workers make datasets and examples; training has a GPU where there is one.
"""

import argparse
import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch  # pyright: ignore[reportMissingImports]

from pcii.base import Executor, Report, Stages, silent
from pcii.depth.surface_network import WEIGHTS
from simgen.app.library import generate_sweep
from simgen.spec import Sweep, load_sweep
from training.batches import DEVICE, Examples
from training.examples import EXAMPLES_OF_DATASET, FLAT_FILMS, make_examples
from training.exported_files import export, load_exported
from training.fit import Training
from training.layers import SurfaceNetwork

RECIPES = Path(__file__).parent / "recipes"
MEGABYTES_PER_EXAMPLE = 10


def main() -> None:
    """Do all that the command line says."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("out"), help="datasets, examples and weights")
    parser.add_argument("--minutes", type=float, default=90, help="of training, in all")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes; all cores")
    parser.add_argument("--anew", action="store_true", help="start from random weights")
    parser.add_argument("--recipes", type=Path, default=RECIPES, help="folder of other recipes")
    arguments = parser.parse_args()
    out, executor = arguments.out / "depth-network", Executor(arguments.workers)
    with Stages() as report:
        recipes = sorted(arguments.recipes.glob("*.toml"))
        collections = make_datasets(recipes, out / "datasets", executor, report)
        make_examples(collections, out / "examples", executor, report)
        network = SurfaceNetwork()
        if not arguments.anew:
            load_exported(network, WEIGHTS)
        print(f"training on {DEVICE}, {arguments.minutes:g} minutes in all", flush=True)
        torch.set_num_threads(arguments.workers)
        training = Training(network, out / "depth.pt")
        if training.minutes < arguments.minutes:
            examples = Examples(out / "examples", report)
            training.fit(examples, arguments.minutes, 4 if DEVICE == "cuda" else 1, report)
        export(training.averaged, out / "weights")
    print(f"{out / 'weights'}: the weights. Put them beside {WEIGHTS} with a card of their own to use them")


def make_datasets(recipes: Sequence[Path], out: Path, executor: Executor, report: Report) -> list[Path]:
    """Make a collection of each recipe in a folder of its name, having said how long it takes."""
    sweeps = {out / file.stem: load_sweep(str(file)) for file in recipes}
    total = sum(map(len, sweeps.values()))
    for number, (folder, sweep) in enumerate(sweeps.items(), start=1):
        first = tuple(replace(axis, values=axis.values[:1]) for axis in sweep.axes)
        _make(replace(sweep, axes=first), folder, Executor(), silent, 0, 1)
        report("first dataset of each recipe", number, len(sweeps))
    hours = 0.0
    for folder, sweep in sweeps.items():
        manifests = [json.loads(file.read_text()) for file in folder.glob("*/manifest.json")]
        seconds = float(np.mean([sum(manifest["timings_s"].values()) for manifest in manifests]))
        left = len(sweep) - len(manifests)
        hours += seconds * left / 3600
        print(f"{folder.name:24}{left:5} of{len(sweep):5} datasets to make, {seconds:.1f} s each")
    examples = EXAMPLES_OF_DATASET * total + FLAT_FILMS
    gigabytes, free = examples * MEGABYTES_PER_EXAMPLE / 1e3, shutil.disk_usage(out).free / 1e9
    print(
        f"{hours:.1f} hours if datasets are made one by one, less by {executor.workers} workers; then "
        f"{examples} examples, up to {gigabytes:.0f} GB on a disk with {free:.0f} GB free",
        flush=True,
    )
    done = 0
    for folder, sweep in sweeps.items():
        _make(sweep, folder, executor, report, done, total)
        done += len(sweep)
    return list(sweeps)


def _make(sweep: Sweep, folder: Path, executor: Executor, report: Report, before: int, total: int) -> None:
    """Make a collection, and report its datasets among those of all, of which some are made before."""

    def report_all(stage: str, done: int, _: int) -> None:
        if stage == "datasets":
            report(stage, before + done, total)

    if faults := generate_sweep(sweep, folder, executor, report_all):
        raise SystemExit(f"{folder}: {len(faults)} datasets were not made, the first because {faults[0]}")


if __name__ == "__main__":
    main()

"""What the constants of depth by the posterior change: each alone is halved and doubled, on datasets.

For each amount of light the table has two means over the datasets: the share of the objects' pixels whose
depth is off by more than 1 px of total disparity, or missing, of which less is better, and the quadratic
score of the confidence, of which more is better.
"""

import argparse
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pcii
from pcii.base.progress import Stages
from pcii.depth.posterior_depth import PosteriorDepth
from pcii.evaluation.method_names import depth_name
from pcii.evaluation.tables import Table, light_name, markdown


def main() -> int:
    """Run the command line; gives the exit code, 2 for bad input."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.depth_constants", description=__doc__)
    parser.add_argument("folders", nargs="+", metavar="FOLDER", help="a dataset, or a collection of them")
    parser.add_argument("--budget", action="append", default=[], help="photons, or full-light (default: all)")
    options, methods = parser.parse_args(), dict(variants())
    functions = [(depth_name(name), method) for name, method in methods.items()]
    try:
        with tempfile.TemporaryDirectory() as folder, Stages() as report:
            folders, budgets, out = options.folders, options.budget, Path(folder) / "scores"
            evaluation = pcii.evaluate(folders, out, methods=functions, budgets=budgets, report=report)
    except pcii.InputError as fault:
        print(f"error: {fault}", file=sys.stderr)
        return 2
    groups: Any = evaluation.frame.groupby(["method", "light"], observed=True)
    cells = groups[["within_1px", "quadratic_score"]].mean()
    cells["text"] = [f"{1 - within:.3f}, {score:.3f}" for within, score in cells.to_numpy()]
    texts = cells["text"].unstack("light")
    rows = [(name, *texts.loc[depth_name(name)]) for name in methods]
    print(markdown(Table("", ("constant", *map(light_name, texts.columns)), tuple(rows))))
    return 0


def variants() -> Iterator[tuple[str, PosteriorDepth]]:
    """The method as it is, and with each of its numbers halved and doubled."""
    default = PosteriorDepth()
    yield "as it is", default
    for part in ("model", "prior", "shown", None):
        owner: Any = getattr(default, part) if part else default
        for name, value in vars(owner).items():
            for factor in (0.5, 2) if isinstance(value, int | float) else ():
                changed = replace(owner, **{name: type(value)(factor * value)})
                yield f"{name} = {factor * value:g}", replace(default, **{part: changed}) if part else changed


if __name__ == "__main__":
    sys.exit(main())

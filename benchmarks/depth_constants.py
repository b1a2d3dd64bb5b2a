"""What the constants of depth and masks change: each alone is halved and doubled, on datasets.

For each amount of light the table has three means over the datasets, of which more is better: the IoU of the
masks at the planes that show objects, the share of the objects' pixels whose depth is right to 1 px of total
disparity, and the quadratic score of the confidence.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

import pcii
from benchmarks.page import table_markdown
from pcii.base import Stages
from pcii.depth import PosteriorDepth, depth_map_of
from pcii.evaluation import NamedMethod, find_datasets, tasks_of
from pcii.evaluation.evaluation_page import light_name
from pcii.figures import text_table
from pcii.removal import masks_of
from pcii.sections import depth_range_of, planes_of
from pcii.types import Light

PARTS = "model", "prior", "shown", "sheets", "search"
"""Of `PosteriorDepth`: those that have constants of their own, and its own constants."""


def main() -> int:
    """Run the command line; gives the exit code, 2 for bad input."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.depth_constants", description=__doc__)
    parser.add_argument("folders", nargs="+", metavar="FOLDER", help="a dataset, or a collection of them")
    parser.add_argument("--budget", action="append", help="photons per view (default: all of each dataset)")
    parser.add_argument("--part", action="append", choices=PARTS, help="its constants alone (default: all)")
    options = parser.parse_args()
    methods = dict(variants(options.part or PARTS))
    try:
        lights_of_options = [Light.parse(budget) for budget in options.budget or ()]
        datasets = [pcii.open_dataset(folder) for folder in find_datasets(options.folders)]
        tasks = tasks_of(datasets, [NamedMethod("posterior")], lights_of_options)
        scores: dict[tuple[str, str], list[tuple[float, ...]]] = {}
        with Stages() as report:
            for number, task in enumerate(tasks):
                data = task.dataset.at_light(task.light)
                for done, (name, method) in enumerate(methods.items(), start=1):
                    scores.setdefault((name, str(task.light)), []).append(_scores(data, method))
                    report("constants", number * len(methods) + done, len(tasks) * len(methods))
    except pcii.InputError as fault:
        print(f"error: {fault}", file=sys.stderr)
        return 2

    def cell(name: str, light: str) -> str:
        return ", ".join(f"{mean:.3f}" for mean in np.mean(scores[name, light], axis=0))

    lights = list(dict.fromkeys(str(task.light) for task in tasks))
    rows = [(name, *(cell(name, light) for light in lights)) for name in methods]
    print(table_markdown(text_table(rows, ("constant", *map(light_name, lights)))))
    return 0


def variants(parts: Sequence[str]) -> Iterator[tuple[str, PosteriorDepth]]:
    """The method as it is, and with each number of its parts halved and doubled."""
    default = PosteriorDepth()
    yield "as it is", default
    for part in parts:
        owner: Any = getattr(default, part, default)
        for name, value in vars(owner).items():
            for factor in (0.5, 2) if isinstance(value, int | float) else ():
                other = type(value)(factor * value)
                changed = replace(owner, **{name: other})
                method = changed if owner is default else replace(default, **{part: changed})
                yield f"{part}: {name} = {other:g}", method


def _scores(data: pcii.Dataset, method: PosteriorDepth) -> tuple[float, ...]:
    z_range_mm, planes = depth_range_of(data), planes_of(data)
    posterior = method.posterior(data.counts, z_range_mm, planes.z_mm)
    masks = masks_of(posterior, pcii.reconstruct(data.counts, planes))
    score = pcii.score(masks, depth_map_of(posterior, z_range_mm), data.truth)
    iou = [plane["iou"] for plane in score.planes if plane["truth"] == "object"]
    return float(np.mean(iou)), score.depth["within_1px"], score.depth["quadratic_score"]


if __name__ == "__main__":
    sys.exit(main())

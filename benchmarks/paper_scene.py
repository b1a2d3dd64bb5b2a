"""Methods on the paper's scene: five draws of its photons at 100, 300 and 1000 per view, and Table 1."""

from collections.abc import Iterator
from pathlib import Path

import pcii
from benchmarks.quoted import named_means
from benchmarks.results import Value, mean_of
from pcii.base import Stages
from pcii.evaluation import summary
from simgen.dataset import generate_collection
from simgen.spec import load_sweep

FOLDER = "paper-scene"
"""Its datasets and scores, in the folder of results."""
SEEDS = 5
LIGHTS = (100, 300, 1000)
METHODS = ("three-step", "posterior", "brightness", "shape-from-focus", "depth")
MEASURES = ("iou", "photon_precision", "photon_recall", "within_1px", "median_px", "median_mm", "bias_px")
SETTINGS = ("products.radiance=none", f"photons.budget={LIGHTS[-1]}", f"photons.nested={[*LIGHTS[:-1]]}")


def measure(out: Path, seeds: int = SEEDS) -> Iterator[tuple[str, Value]]:
    """Make and score what is missing in the folder; gives means over draws by name.

    Names are paper.measure.method.photons of masks and of depth maps, paper.entropy_bits.object.depth.
    """
    sweep = load_sweep("paper", SETTINGS, seeds=seeds)
    folders = [out / "data" / sweep.folder(number) for number in range(seeds)]
    with Stages() as progress:
        generate_collection(sweep, out / "data")
        evaluation = pcii.evaluate(folders, out / "scores", methods=METHODS, report=progress)
    yield from named_means("paper", summary.means(evaluation.frame), MEASURES)
    yield from _entropies(folders)


def _entropies(folders: list[Path]) -> Iterator[tuple[str, Value]]:
    """Table 1, of any method: entropies are of the sections."""
    tables = []
    for folder in folders:
        dataset = pcii.open_dataset(folder)
        focus = pcii.segment(dataset.counts, dataset.analysis["z_mm"], method="brightness")
        tables.append(pcii.score(focus, None, dataset.truth).objects)
    for of_seeds in zip(*tables, strict=True):
        for z_mm in of_seeds[0]["entropy"]:
            bits = mean_of(row["entropy"][z_mm] for row in of_seeds)
            yield f"paper.entropy_bits.{of_seeds[0]['name']}.{z_mm}", bits

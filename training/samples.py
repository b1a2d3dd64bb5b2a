"""Examples to train on: inputs of the network for datasets, at random amounts of light, with the true depth.

    python -m training.samples DATASETS... --out FOLDER [--each 2]

DATASETS are collections that `simgen generate training/recipes/NAME.toml` makes. Each example is a file;
those that are there are not made again. Photons are thinned at random, by which Poisson counts stay Poisson
counts, to between `LEAST_PHOTONS` per view and all, evenly in their logarithm.
"""

import argparse
import io
import zlib
from pathlib import Path

import numpy as np

import pcii
from pcii.core.camera_grid import CameraGrid
from pcii.core.focal_planes import FocalPlanes
from pcii.core.geometry import total_disparity_px
from pcii.core.truth import Truth
from pcii.depth.posterior_depth import PosteriorDepth
from pcii.evidence.texture_evidence import evidence_of_texture
from pcii.io.dataset import Dataset
from pcii.store.safe_files import write_bytes_safely

LEAST_PHOTONS = 60.0
NEAR, FAR = (0.75, 0.95), (1.05, 1.4)
"""How far the range of depths goes beyond the planes of a scene."""
MOST_VALUES = 1 << 22
"""Blocks times planes of an example; what is larger is cut to a part of the film."""


def main() -> None:
    """Make the examples of the datasets named on the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("collections", nargs="+", type=Path)
    parser.add_argument("--out", required=True, type=Path)
    parser.add_argument("--each", type=int, default=2, help="examples of a dataset")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for collection in arguments.collections:
        for folder in sorted(path.parent for path in collection.glob("*/manifest.json")):
            write_examples(
                pcii.open_dataset(folder), f"{collection.name}_{folder.name}", arguments.each, arguments.out
            )


def write_examples(dataset: Dataset, name: str, count: int, out: Path) -> None:
    """Write so many examples of a dataset, those that are not there yet."""
    for number in range(count):
        file = out / f"{name}_{number}.npz"
        if not file.exists():
            write_example(file, example_of(dataset, np.random.default_rng(zlib.crc32(file.stem.encode()))))


def example_of(dataset: Dataset, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Inputs at half precision, and `plane` (H, W) float32, the true plane as a fraction; NaN beyond them."""
    counts, truth, grid = dataset.counts, dataset.truth, dataset.grid
    assert truth is not None
    views = grid.view_count
    photons = views * np.exp(
        rng.uniform(np.log(LEAST_PHOTONS), np.log(max(counts.total / views, LEAST_PHOTONS)))
    )
    z_mm = np.asarray(dataset.analysis["z_mm"])
    planes = FocalPlanes.between(grid, rng.uniform(*NEAR) * z_mm.min(), rng.uniform(*FAR) * z_mm.max(), 1.0)
    method = PosteriorDepth()
    dimmed = counts.subsample(photons, rng)
    evidence = evidence_of_texture(dimmed, planes, method.block_px, method.model)
    inputs = method.network_inputs(evidence, planes, method.block_px)
    example = {name: part.astype(np.float16) for name, part in inputs._asdict().items()}
    return _part(example | {"plane": true_plane(truth, grid, planes)}, rng)


def true_plane(truth: Truth, grid: CameraGrid, planes: FocalPlanes) -> np.ndarray:
    """Where among the planes the surface is (H, W) float32, 0 the first; NaN where none is between them."""
    total = planes.total_disparity_px
    step = (total[-1] - total[0]) / (len(planes) - 1)
    with np.errstate(divide="ignore"):
        place = (total_disparity_px(grid, truth.z_mm) - total[0]) / step
    inside = (place > -0.5) & (place < len(planes) - 0.5) & np.isfinite(truth.z_mm)
    return np.where(inside, place, np.nan).astype(np.float32)


def _part(example: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
    """The example, or a part of its film of at most `MOST_VALUES`."""
    Z, h, w = example["evidence"].shape
    side = int(np.sqrt(MOST_VALUES / Z)) // 16 * 16
    cut = {}
    top, left = (int(rng.integers(0, max(1, (size - side) // 16 + 1))) * 16 for size in (h, w))
    for name, values in example.items():
        if values.ndim == 1:
            cut[name] = values
            continue
        per_block = {"plane": PosteriorDepth.block_px, "coverage": 0.5, "surface": 0.5}.get(name, 1)
        rows, columns = (
            slice(int(first * per_block), int((first + side) * per_block)) for first in (top, left)
        )
        cut[name] = values[..., rows, columns]
    return cut


def write_example(file: Path, example: dict[str, np.ndarray]) -> None:
    """Write an example as one file, at once."""
    content = io.BytesIO()
    np.savez(content, **example)  # type: ignore[arg-type]
    write_bytes_safely(file, content.getvalue())


if __name__ == "__main__":
    main()

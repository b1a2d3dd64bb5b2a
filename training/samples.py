"""Examples to train on: inputs of the network for datasets, at random amounts of light, with the truth.

    python -m training.samples DATASETS... --out FOLDER [--each 2]

DATASETS are collections that `simgen generate training/recipes/NAME.toml` makes. Each example is a file;
those that are there are not made again. Photons are thinned at random, by which Poisson counts stay Poisson
counts, to between `MIN_PHOTONS` per view and all, evenly in their logarithm. Which planes are asked for is
not part of an example: `training.requests` draws it anew each time that one is used.
"""

import argparse
import io
import zlib
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import pcii
from pcii.base.safe_files import write_bytes_safely
from pcii.depth.posterior_depth import PosteriorDepth
from pcii.evidence.hot_pixels import without_hot_pixels
from pcii.evidence.texture_evidence import evidence_of_texture
from pcii.types.focal_planes import FocalPlanes
from pcii.types.geometry import total_disparity_px
from pcii.types.photon_counts import PhotonCounts
from pcii.types.truth import Truth

MIN_PHOTONS = 30.0
NEAR, FAR = (0.75, 0.95), (1.05, 1.4)
"""How far the range of depths goes beyond the planes of a scene, as factors of the depth of its ends."""
MAX_VALUES = 1 << 22
"""Largest number of blocks times planes of an example; what is larger is cut to a part of the film."""

Example = dict[str, np.ndarray]


def main() -> None:
    """Make the examples of the datasets named on the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("collections", nargs="+", type=Path)
    parser.add_argument("--out", required=True, type=Path)
    parser.add_argument("--each", type=int, default=2, help="examples of a dataset")
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    requests = list(missing_examples(arguments.collections, arguments.each, arguments.out))
    with ProcessPoolExecutor(arguments.workers) as pool:
        for number, _ in enumerate(pool.map(write_example, *zip(*requests, strict=True)), start=1):
            print(f"{number} of {len(requests)} examples", end="\r", flush=True)


def missing_examples(collections: list[Path], count: int, out: Path) -> Iterator[tuple[Path, Path]]:
    """Folders of datasets, and the files of their examples that are not there yet."""
    for collection in collections:
        for folder in sorted(path.parent for path in collection.glob("*/manifest.json")):
            for number in range(count):
                file = out / f"{collection.name}_{folder.name}_{number}.npz"
                if not file.exists():
                    yield folder, file


def write_example(folder: Path, file: Path) -> None:
    """Write an example of a dataset; its name decides on all that is random."""
    dataset, rng = pcii.open_dataset(folder), np.random.default_rng(zlib.crc32(file.stem.encode()))
    counts, truth, views = dataset.counts, dataset.truth, dataset.grid.view_count
    assert truth is not None
    brightest = max(counts.total / views, MIN_PHOTONS)
    photons = views * np.exp(rng.uniform(np.log(MIN_PHOTONS), np.log(brightest)))
    z_mm = np.asarray(dataset.analysis["z_mm"])
    write(example_of(counts.subsample(photons, rng), truth, z_mm, rng), file)


def write(example: Example, file: Path) -> None:
    """Write an example as one file, at once."""
    content = io.BytesIO()
    np.savez(content, **example)  # type: ignore[arg-type]
    write_bytes_safely(file, content.getvalue())


def example_of(counts: PhotonCounts, truth: Truth, z_mm: np.ndarray, rng: np.random.Generator) -> Example:
    """Inputs without a hint at half precision, and the truth.

    `plane` (H, W) float32 is the true plane as a fraction, NaN beyond them; `object_id` (H, W) int16;
    `objects` (N, 4) float32 are id, median plane, planes that the object reaches over, and share of the film;
    `named_planes` (R,) float32 the planes at the depths `z_mm` (R,) that the scene names.
    """
    grid = counts.grid
    planes = FocalPlanes.between(grid, rng.uniform(*NEAR) * z_mm.min(), rng.uniform(*FAR) * z_mm.max(), 1.0)
    method = PosteriorDepth()
    counts, _ = without_hot_pixels(counts, planes)
    evidence = evidence_of_texture(counts, planes, method.block_px, method.model)
    inputs = method.network_inputs(evidence, planes, method.block_px, np.zeros(0))._asdict()
    del inputs["hint"]
    example = {name: part.astype(np.float16) for name, part in inputs.items()}
    place = plane_of(planes, total_disparity_px(grid, np.where(truth.z_mm > 0, truth.z_mm, np.inf)))
    is_inside = (place > -0.5) & (place < len(planes) - 0.5) & np.isfinite(truth.z_mm)
    example |= {
        "plane": np.where(is_inside, place, np.nan).astype(np.float32),
        "object_id": truth.object_id.astype(np.int16),
        "objects": objects_of(truth, place),
        "named_planes": plane_of(planes, total_disparity_px(grid, z_mm)).astype(np.float32),
    }
    return cut(example, rng)


def plane_of(planes: FocalPlanes, total_px: np.ndarray) -> np.ndarray:
    """Where among the planes total disparities are, 0 the first, as fractions."""
    total = planes.total_disparity_px
    return (total_px - total[0]) / ((total[-1] - total[0]) / (len(planes) - 1))


def objects_of(truth: Truth, place: np.ndarray) -> np.ndarray:
    """Id, median plane, planes between the 2nd and 98th percentile, share of the film: (N, 4) float32."""
    rows = []
    for number in np.unique(truth.object_id[truth.object_id > 0]):
        own = place[truth.object_id == number]
        low, middle, high = np.percentile(own[np.isfinite(own)], [2, 50, 98])
        rows.append((number, middle, high - low, own.size / place.size))
    return np.array(rows, np.float32).reshape(-1, 4)


def cut(example: Example, rng: np.random.Generator) -> Example:
    """The example, or a part of its film of at most `MAX_VALUES`."""
    Z, h, w = example["evidence"].shape
    side = int(np.sqrt(MAX_VALUES / Z)) // 16 * 16
    top, left = (int(rng.integers(0, max(1, (size - side) // 16 + 1))) * 16 for size in (h, w))
    return {name: window(name, values, top, left, side) for name, values in example.items()}


def window(name: str, values: np.ndarray, top: int, left: int, side: int) -> np.ndarray:
    """The rows and columns of a part of an example, whose ends are given in blocks."""
    per_block = {
        "plane": PosteriorDepth.block_px,
        "object_id": PosteriorDepth.block_px,
        "evidence": 1,
        "brightness": 1,
        "coverage": 0.5,
        "surface": 0.5,
    }.get(name)
    if per_block is None:
        return values
    rows, columns = (slice(int(at * per_block), int((at + side) * per_block)) for at in (top, left))
    return values[..., rows, columns]


if __name__ == "__main__":
    main()

"""Examples to train on: inputs of the network for datasets, at random amounts of light, with the truth.

Each example is a file, and one that is there is not made again. Photons are thinned at random, by which
Poisson counts stay Poisson counts, to between `MIN_PHOTONS` per view and all, evenly in their logarithm.
Which planes are requested is not part of an example: `training.requests` draws that at each use.
"""

import io
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import pcii
from pcii.base import Executor, Report, write_bytes_safely
from pcii.depth import PosteriorDepth
from pcii.depth.surface_network import MULTIPLE
from pcii.evidence import evidence_of_texture, without_hot_pixels
from pcii.types import FocalPlanes, PhotonCounts, Truth, total_disparity_px
from training.flat_films import FLAT_FILM, draw_flat_film

EXAMPLES_OF_DATASET = 2
FLAT_FILMS = 200
MIN_PHOTONS = 30.0
NEAR, FAR = (0.75, 0.95), (1.05, 1.4)
"""How far the range of depths goes beyond the planes of a scene, as factors of the depth of its ends."""
MAX_VALUES = 1 << 22
"""Largest number of blocks times planes of an example; what is larger is cut to a part of the film."""
METHOD = PosteriorDepth()
FILM_MULTIPLE_PX = METHOD.block_px * MULTIPLE
PIXELS, BLOCKS, CELLS = METHOD.block_px, 1, 0.5
"""Samples along a side of a block, of maps of pixels, of blocks, and of cells of two blocks."""
SAMPLES_PER_BLOCK = {"plane": PIXELS, "object_number": PIXELS, "evidence": BLOCKS, "brightness": BLOCKS}
SAMPLES_PER_BLOCK |= {"coverage": CELLS, "surface": CELLS}

Example = dict[str, np.ndarray]


def make_examples(folders: Sequence[Path], out: Path, executor: Executor, report: Report) -> None:
    """Make the examples of all datasets in these folders of collections, and of flat films, in `out`."""
    out.mkdir(parents=True, exist_ok=True)
    sources = [(None, out / f"{FLAT_FILM}_draw_{number}_0.npy") for number in range(FLAT_FILMS)]
    for folder in folders:
        for dataset in sorted(path.parent for path in folder.glob("*/manifest.json")):
            stem = f"{folder.name}_{dataset.name}"
            sources += [(dataset, out / f"{stem}_{number}.npy") for number in range(EXAMPLES_OF_DATASET)]
    missing = [source for source in sources if not source[1].exists()]
    for done, _ in enumerate(executor.run(ExampleJob(missing), range(len(missing))), start=1):
        report("examples", done, len(missing))


class ExampleJob:
    """Writes examples: of each the folder of its dataset, None for a flat film, and its file."""

    def __init__(self, sources: Sequence[tuple[Path | None, Path]]) -> None:
        self.sources = sources

    def __call__(self, number: int) -> None:
        """Write an example; the name of its file decides on all that is random."""
        folder, file = self.sources[number]
        rng = np.random.default_rng(zlib.crc32(file.stem.encode()))
        if folder is None:
            counts, z_mm = draw_flat_film(rng, MIN_PHOTONS)
            shape = counts.grid.shape_HW
            truth = Truth(np.full(shape, np.inf), np.zeros(shape, np.int16), {})
        else:
            dataset = pcii.open_dataset(folder)
            views, z_mm = dataset.grid.view_count, np.asarray(dataset.analysis["z_mm"])
            brightest = max(dataset.counts.total / views, MIN_PHOTONS)
            photons = views * np.exp(rng.uniform(np.log(MIN_PHOTONS), np.log(brightest)))
            counts, truth = dataset.counts.subsample(photons, rng), dataset.truth
            assert truth is not None
        write_example(example_of(counts, truth, z_mm, rng), file)


def example_of(counts: PhotonCounts, truth: Truth, z_mm: np.ndarray, rng: np.random.Generator) -> Example:
    """Inputs without a hint at half precision, and the truth, of a film or of a part of it.

    `plane` (H, W) float32 is the true plane as a fraction, NaN beyond them; `object_number` (H, W) int16 is
    that of a row of `objects`, from 1, or 0; `objects` (N, 3) float32 are median plane, planes that an object
    reaches over, and share of the film; `named_planes` (R,) float32 the planes at the depths `z_mm` (R,) that
    the scene names. Sides of films are whole multiples of `FILM_MULTIPLE_PX`.
    """
    grid = counts.grid
    assert not any(size % FILM_MULTIPLE_PX for size in grid.shape_HW), grid
    planes = FocalPlanes.between(grid, rng.uniform(*NEAR) * z_mm.min(), rng.uniform(*FAR) * z_mm.max(), 1.0)
    counts, _ = without_hot_pixels(counts, planes)
    evidence = evidence_of_texture(counts, planes, METHOD.block_px, METHOD.model)
    inputs = METHOD.network_inputs(evidence, planes, METHOD.block_px, np.zeros(0))._asdict()
    del inputs["hint"]
    place = plane_of(planes, total_disparity_px(grid, np.where(truth.z_mm > 0, truth.z_mm, np.inf)))
    is_inside = (place > -0.5) & (place < len(planes) - 0.5) & np.isfinite(truth.z_mm)
    ids = np.unique(truth.object_id[truth.object_id > 0])
    numbers = np.searchsorted(ids, truth.object_id) + 1
    example = {name: part.astype(np.float16) for name, part in inputs.items()} | {
        "plane": np.where(is_inside, place, np.nan).astype(np.float32),
        "object_number": np.where(truth.object_id > 0, numbers, 0).astype(np.int16),
        "objects": objects_of(truth.object_id, ids, place),
        "named_planes": plane_of(planes, total_disparity_px(grid, z_mm)).astype(np.float32),
    }
    Z, h, w = example["evidence"].shape
    side = int(np.sqrt(MAX_VALUES / Z)) // 16 * 16
    top, left = (int(rng.integers(0, max(1, (size - side) // 16 + 1))) * 16 for size in (h, w))
    return {name: window(name, values, top, left, side) for name, values in example.items()}


def plane_of(planes: FocalPlanes, total_px: np.ndarray) -> np.ndarray:
    """Where among the planes total disparities are, 0 the first, as fractions."""
    total = planes.total_disparity_px
    return (total_px - total[0]) / ((total[-1] - total[0]) / (len(planes) - 1))


def objects_of(object_id: np.ndarray, ids: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Median plane, planes between the 2nd and 98th percentile, share of the film: (N, 3) float32."""
    rows = []
    for planes_of_object in (place[object_id == each] for each in ids):
        low, middle, high = np.percentile(planes_of_object[np.isfinite(planes_of_object)], [2, 50, 98])
        rows.append((middle, high - low, planes_of_object.size / place.size))
    return np.array(rows, np.float32).reshape(-1, 3)


def window(name: str, values: Any, top: int, left: int, side: int) -> Any:
    """The rows and columns of a part of an example's array, whose place and side are given in blocks."""
    if name not in SAMPLES_PER_BLOCK:
        return values
    scale = SAMPLES_PER_BLOCK[name]
    rows, columns = (slice(int(at * scale), int((at + side) * scale)) for at in (top, left))
    return values[..., rows, columns]


def write_example(example: Example, file: Path) -> None:
    """Write an example as a file of one record, which can be mapped into memory."""
    fields = [(name, values.dtype, values.shape) for name, values in example.items()]
    record = np.zeros(1, np.dtype(fields, align=True))
    for name, values in example.items():
        record[0][name] = values
    content = io.BytesIO()
    np.save(content, record)
    write_bytes_safely(file, content.getvalue())


def read_example(file: Path, *, is_mapped: bool = False) -> Example:
    """An example, read into memory or, if `is_mapped`, from the file whenever it is used."""
    record = np.load(file, mmap_mode="c" if is_mapped else None)[0]
    return {name: record[name] for name in record.dtype.names}

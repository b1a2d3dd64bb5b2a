"""Examples to train on: parts of the films of datasets, in a random pose and in light drawn at each access.

All of it is exact. Photons that are kept at random are Poisson counts of less light. Where a film is mirrored
or transposed its cameras are too, and so are its Bayer pattern, pitch and shear, so that disparities stay.
"""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from pcii.base import InputError
from pcii.evidence import evidence_of_texture
from pcii.metrics import TrueFocus
from pcii.sections import depth_range_of, reconstruct
from pcii.store import Collection, Dataset, Split, open_collection
from pcii.types import (
    PATTERNS,
    CameraGrid,
    FocalPlanes,
    PhotonCounts,
    Truth,
    colour_cells,
    colour_index,
    total_disparity_px,
)

Field = Literal["counts", "sections", "evidence", "truth"]
Example = dict[str, np.ndarray]
SPLITS: tuple[Split, ...] = get_args(Split)
CROP_STEP_PX = 4
"""Parts begin at multiples of this: of Bayer patterns, and of the blocks of evidence."""


def examples(
    data: str | Path | Collection | Sequence[Dataset],
    fields: Sequence[Field] = ("sections", "truth"),
    *,
    planes: int | Sequence[float] = 17,
    split: Split | None = None,
    shares: tuple[float, float, float] | None = None,
    by: Literal["scene", "seed"] = "scene",
    photons: tuple[float, float] | None = None,
    crop_px: tuple[int, int] | None = None,
    poses: bool = False,
    seed: int | None = None,
) -> "Examples":
    """Datasets as a sequence of examples: dictionaries of arrays, as the `DataLoader` of PyTorch takes them.

    `data` is a collection or its folder, or datasets. `fields` are what an example has:

    * "counts": `counts` (K, L, H, W) int32.
    * "sections": `sections` (Z, C, H, W) float32, photons per sample at each plane (Eq. 3).
    * "evidence": `evidence` (Z, H / 2, W / 2) float32, the evidence of texture at each plane in nats.
    * "truth": `z_mm` (H, W) float32, infinite where nothing is; `object_id` (H, W) int16; `in_focus`
      (Z, H, W) bool; `plane` (H, W) int64, the nearest plane, -1 where nothing is, what is counts in no
      score, or all planes are farther than half the largest distance between two (of a single plane: is not
      in it).

    `planes` are depths in mm, or a number of planes that are spread evenly in disparity over the depth range
    of each dataset. `split` takes the datasets of one split: that of a collection of drawn scenes (see
    `split_of`), or with `shares` of the three (in the order train, validation, test) by a hash of the scene,
    so that no scene is in two of them, or `by` the seed of a single scene. `photons` are the least and the
    most per view: each access draws a number in between, evenly by its logarithm but no more than the dataset
    has, and keeps as many. `crop_px` (rows, columns), multiples of 4, takes a part at a random place; `poses`
    mirrors at random, and transposes where films or parts are square; `counts` then have rows and columns of
    cameras exchanged. Each access is another draw; with a `seed` it follows from the seed, the `epoch` of the
    examples, which you count up, and the number.

    Raises `InputError` for a field, split or number that cannot be, and on access for what a dataset lacks.
    """
    return Examples(_of_split(data, split, shares, by), tuple(fields), planes, photons, crop_px, poses, seed)


@dataclass(eq=False)
class Examples(Sequence[Example]):
    """A sequence with one example for each dataset. Each access opens its dataset again."""

    datasets: Sequence[Dataset]
    fields: tuple[Field, ...]
    planes: int | Sequence[float]
    photons: tuple[float, float] | None
    crop_px: tuple[int, int] | None
    poses: bool
    seed: int | None
    epoch: int = 0

    def __post_init__(self) -> None:
        fields = get_args(Field)
        if not self.fields or not {*self.fields} <= {*fields}:
            raise InputError(f"fields: expected some of {', '.join(fields)}, got {self.fields}")
        if isinstance(self.planes, int) and self.planes < 2:
            raise InputError(f"planes: expected at least 2, or depths in mm, got {self.planes}")
        if self.photons is not None and not 0 < self.photons[0] <= self.photons[1] < math.inf:
            raise InputError(f"photons: expected the least and the most per view, got {self.photons}")
        if self.crop_px is not None and (min(self.crop_px) < 1 or np.any(np.mod(self.crop_px, CROP_STEP_PX))):
            raise InputError(f"crop_px: expected multiples of {CROP_STEP_PX}, got {self.crop_px}")

    def __len__(self) -> int:
        return len(self.datasets)

    def __getitem__(self, number: int) -> Example:  # pyright: ignore[reportIncompatibleMethodOverride]
        dataset = self.datasets[number]
        entropy = None if self.seed is None else (self.seed, self.epoch, number % len(self))
        rng = np.random.default_rng(entropy)
        pose = _Pose.random(dataset.grid, self.crop_px, self.poses, rng)
        grid = pose.of_grid(dataset.grid)
        if isinstance(self.planes, int):
            near_px, far_px = total_disparity_px(grid, np.array(depth_range_of(dataset)))
            planes = FocalPlanes.at_total_disparity(grid, np.linspace(near_px, far_px, self.planes))
        else:
            planes = FocalPlanes.at_depths(grid, self.planes)
        example: Example = {}
        if {*self.fields} - {"truth"}:
            counts = pose.of_counts(dataset.counts)
            if self.photons is not None:
                counts = _thinned(dataset, counts, self.photons, rng)
            if "counts" in self.fields:
                example["counts"] = counts.dense.astype(np.int32)
            if "sections" in self.fields:
                estimate = reconstruct(counts, planes).estimate
                example["sections"] = np.ascontiguousarray(np.moveaxis(estimate, 3, 1), np.float32)
            if "evidence" in self.fields:
                example["evidence"] = evidence_of_texture(counts, planes).nats
        if "truth" in self.fields:
            if dataset.truth is None:
                raise InputError(f"{dataset.path}: has no truth, which the field 'truth' is made of")
            example |= _truth_fields(pose.of_truth(dataset.truth), planes)
        return example


@dataclass(frozen=True)
class _Pose:
    """A part of a film, mirrored along `flips` (0 rows, 1 columns), then maybe transposed."""

    corner: tuple[int, int]
    size: tuple[int, int]
    flips: tuple[int, ...]
    is_transposed: bool

    @classmethod
    def random(
        cls, grid: CameraGrid, crop_px: tuple[int, int] | None, poses: bool, rng: np.random.Generator
    ) -> "_Pose":
        height, width = crop_px or grid.shape_HW
        if height > grid.height or width > grid.width:
            raise InputError(f"crop_px: {height} x {width} is larger than {grid.height} x {grid.width} px")
        steps = (grid.height - height) // CROP_STEP_PX, (grid.width - width) // CROP_STEP_PX
        top, left = (CROP_STEP_PX * int(rng.integers(most + 1)) for most in steps)
        draws = rng.random(3) < 0.5 if poses else (False, False, False)
        flips = tuple(axis for axis in range(2) if draws[axis])
        is_transposed = bool(draws[2]) and height == width
        return cls((top, left), (height, width), flips, is_transposed)

    def of_map(self, values: np.ndarray) -> np.ndarray:
        """The part of a map (H, W, ...)."""
        (top, left), (height, width) = self.corner, self.size
        part = np.flip(values[top : top + height, left : left + width], self.flips)
        return np.ascontiguousarray(part.swapaxes(0, 1) if self.is_transposed else part)

    def of_grid(self, grid: CameraGrid) -> CameraGrid:
        """The cameras of the part. Their axes meet it anywhere, on which no disparity depends."""
        grid = replace(grid, height=self.size[0], width=self.size[1])
        if not self.is_transposed:
            return grid
        turned = {"rows": grid.cols, "cols": grid.rows, "height": grid.width, "width": grid.height}
        return replace(grid, **turned, pitch_mm=grid.pitch_mm[::-1], shear_px=grid.shear_px[::-1])

    def of_counts(self, counts: PhotonCounts) -> PhotonCounts:
        """The photons of the part, in cameras that are mirrored and transposed with it."""
        grid, events = counts.grid, counts.events
        (top, left), (height, width) = self.corner, self.size
        i, j = events.i - top, events.j - left
        is_inside = (i >= 0) & (i < height) & (j >= 0) & (j < width)
        k, l, i, j, n = (column[is_inside] for column in (events.k, events.l, i, j, events.n))
        if 0 in self.flips:
            k, i = grid.rows - 1 - k, height - 1 - i
        if 1 in self.flips:
            l, j = grid.cols - 1 - l, width - 1 - j
        if self.is_transposed:
            k, l, i, j = l, k, j, i
        cfa = counts.cfa
        if cfa is not None:
            cells = self.of_map(colour_index(*grid.shape_HW, cfa))[:2, :2]
            rows, cols = (slice(size) for size in cells.shape)  # a film may be one pixel high or wide
            cfa = next(name for name in PATTERNS if (colour_cells(name)[rows, cols] == cells).all())
        frames, bits = counts.readout.frames, counts.readout.bits
        return PhotonCounts.from_events(k, l, i, j, n, self.of_grid(grid), cfa=cfa, frames=frames, bits=bits)

    def of_truth(self, truth: Truth) -> Truth:
        """The truth of the part."""
        others = dict.fromkeys(("photons", "normal", "coverage", "visible_views"))
        return replace(truth, z_mm=self.of_map(truth.z_mm), object_id=self.of_map(truth.object_id), **others)


def _thinned(
    dataset: Dataset, counts: PhotonCounts, photons: tuple[float, float], rng: np.random.Generator
) -> PhotonCounts:
    """Counts of less light: of a number of photons per view that is drawn between two, or all there are."""
    if counts.readout.bits is not None:
        raise InputError(
            f"{dataset.path}: has frames of {counts.readout.bits} bits, of which no less light can be drawn; "
            "leave out photons"
        )
    light = dataset.light
    most = light.photons if light.scope == "view" else None
    most = dataset.counts.total / dataset.grid.view_count if most is None else most
    if photons[0] > most:
        raise InputError(f"{dataset.path}: has {most:.4g} photons per view, fewer than photons[0] asks for")
    target = math.exp(rng.uniform(*np.log(photons)))
    return counts.subsample(counts.total * min(target / most, 1.0), rng)


def _truth_fields(truth: Truth, planes: FocalPlanes) -> Example:
    focus = TrueFocus(planes, truth)
    plane, off_px = focus.blur_px.argmin(axis=0), 2 * focus.blur_px.min(axis=0)
    reach_px = np.diff(np.sort(total_disparity_px(planes.grid, planes.z_mm))).max(initial=0) / 2
    is_known = np.isfinite(truth.z_mm) & ~truth.is_unscored & (off_px <= reach_px)
    return {
        "z_mm": truth.z_mm.astype(np.float32),
        "object_id": truth.object_id.astype(np.int16),
        "in_focus": focus.by_pixel,
        "plane": np.where(is_known, plane, -1).astype(np.int64),
    }


def _of_split(
    data: str | Path | Collection | Sequence[Dataset],
    split: Split | None,
    shares: tuple[float, float, float] | None,
    by: Literal["scene", "seed"],
) -> Sequence[Dataset]:
    """The datasets of a split; `InputError` for one that there is not, or that would be empty."""
    data = open_collection(data) if isinstance(data, str | Path) else data
    if split is None:
        return data
    if split not in SPLITS or by not in ("scene", "seed"):
        raise InputError(
            f"split, by: expected one of {', '.join(SPLITS)}, and scene or seed, got {split}, {by}"
        )
    is_collection = isinstance(data, Collection)
    rows = data.rows if is_collection else [dict(dataset.manifest.recipe) for dataset in data]
    splits = [row["split"] if is_collection else None for row in rows]
    if shares is not None:
        if min(shares) < 0 or not math.isclose(sum(shares), 1, abs_tol=1e-6):
            raise InputError(f"shares: expected three shares that sum to 1, got {shares}")
        ends = np.cumsum(shares)
        of_scene = by == "scene"
        keys = [(r.get("scene"), r.get("scene_number")) if of_scene else r.get("seed") for r in rows]
        # Numbers from 0 to 1 that are the same for a key on every machine.
        digests = [hashlib.sha256(repr(key).encode()).digest() for key in keys]
        places = [int.from_bytes(digest[:8], "big") / 2**64 for digest in digests]
        splits = [SPLITS[min(int(place), 2)] for place in np.searchsorted(ends, places, "right")]
    elif None in splits:
        raise InputError("shares: missing; scenes that are not drawn have no split of their own")
    mask = [each == split for each in splits]
    if not any(mask):
        other = "scene" if by == "seed" else "seed"
        raise InputError(f"split: no dataset is in the split {split}; choose other shares, or by={other!r}")
    return data[mask] if is_collection else [*compress(data, mask)]

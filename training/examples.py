"""Batches of examples: parts of films, mirrored and transposed at random, each with a request of its own."""

import zlib
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from pcii.depth.network_inputs import NetworkInputs, hint_of
from pcii.depth.surface_network import MULTIPLE
from training.requests import draw_request
from training.samples import Example, window

HELD_OUT = 24
"""One dataset in this many is not trained on."""
MAX_VALUES = {"cpu": 3_000_000, "cuda": 24_000_000}
"""Largest number of blocks times planes of a step."""
SIDES = (96, 128, 192, 256)
"""Blocks along the sides of the parts of films; those of a step are alike. Narrow things are learned from
many small parts, wide ones and empty film from whole films."""
WAITING_BATCHES = 8
"""Batches that are ready before their step."""
DEVICE = "cuda" if torch.cuda.is_available() else "cpu"


class Batch(NamedTuple):
    """Inputs of B examples with as many planes, and what is true of them.

    `plane` (B, h, w) is the true plane as a fraction, NaN where there is none; `planes` (B, R) are requested
    ones, NaN beyond an example's own; `target` (B, h, w) is a number of these, R for none, or `NOT_COUNTED`.
    """

    inputs: list[Tensor]
    plane: Tensor
    planes: Tensor
    target: Tensor


class Examples:
    """Examples of a folder, read ahead of their use."""

    def __init__(self, folder: Path, pool: ThreadPoolExecutor) -> None:
        files = sorted(folder.glob("*.npz"))
        self.plane_count = dict(zip(files, pool.map(_plane_count, files), strict=True))
        self.held_out = [file for file in files if _is_held_out(file)]
        self.kinds: dict[str, list[Path]] = {}
        self.of_planes: dict[int, list[Path]] = {}
        for file in files:
            if not _is_held_out(file):
                self.kinds.setdefault(file.stem.split("_draw_")[0].split("scene_")[-1], []).append(file)
                self.of_planes.setdefault(self.plane_count[file], []).append(file)

    def batches(self, rng: np.random.Generator, pool: ThreadPoolExecutor) -> Iterator[Batch]:
        """Batches without end: an example of any kind of scene, all kinds alike, and others of as many
        planes."""
        kinds, waiting = list(self.kinds.values()), deque[Future[Batch]]()
        while True:
            while len(waiting) < WAITING_BATCHES:
                kind = kinds[rng.integers(len(kinds))]
                first = kind[rng.integers(len(kind))]
                planes = self.plane_count[first]
                side = SIDES[rng.integers(len(SIDES))]
                count = max(1, MAX_VALUES[DEVICE] // (planes * side**2))
                alike = self.of_planes[planes]
                files = [first, *(alike[at] for at in rng.integers(len(alike), size=count - 1))]
                task = self.batch, files, side, np.random.default_rng(rng.integers(2**32))
                waiting.append(pool.submit(*task))
            yield _on_device(waiting.popleft().result())

    def batch(self, files: list[Path], side: int, rng: np.random.Generator) -> Batch:
        """Square parts of examples, `side` blocks wide or as wide as the narrowest of their films."""
        examples = [_read(file) for file in files]
        sides = (size for each in examples for size in each["evidence"].shape[1:])
        side = min(side, *sides) // MULTIPLE * MULTIPLE
        parts = [_part(example, side, rng) for example in examples]
        requests = [
            draw_request(each["objects"], each["named_planes"], self.plane_count[files[0]], rng)
            for each in examples
        ]
        most = max(request.planes.size for request in requests)
        planes = np.full((len(files), most), np.nan, np.float32)
        targets, hints = [], []
        for number, (part, request) in enumerate(zip(parts, requests, strict=True)):
            planes[number, : request.planes.size] = request.planes
            of_id = np.full(
                max(int(part["object_id"].max()), int(part["objects"][:, 0].max(initial=0))) + 1, 0
            )
            of_id[part["objects"][:, 0].astype(int)] = np.arange(1, len(part["objects"]) + 1)
            targets.append(request.targets[of_id[np.maximum(part["object_id"], 0)]])
            hints.append(hint_of(self.plane_count[files[0]], request.planes))
        for target, request in zip(targets, requests, strict=True):
            target[target == request.planes.size] = most
        stacked = {name: np.stack([part[name] for part in parts]) for name in NetworkInputs._fields[:-1]}
        inputs = [torch.from_numpy(values.astype(np.float32)) for values in stacked.values()]
        return Batch(
            [*inputs, torch.from_numpy(np.stack(hints))],
            torch.from_numpy(np.stack([part["plane"] for part in parts])),
            torch.from_numpy(planes),
            torch.from_numpy(np.stack(targets)),
        )


def _part(example: Example, side: int, rng: np.random.Generator) -> Example:
    """A square part of an example, `side` blocks wide; of the truth a random pixel of each block."""
    h, w = example["evidence"].shape[1:]
    top, left = (2 * int(rng.integers(0, (size - side) // 2 + 1)) for size in (h, w))
    down, right = rng.integers(0, 2, 2)
    flips = [axis for axis in (-1, -2) if rng.random() < 0.5]
    is_transposed = rng.random() < 0.5
    part = {}
    for name, values in example.items():
        own = window(name, values, top, left, side)
        if name in ("plane", "object_id"):
            own = own[down::2, right::2]
        if own.ndim > 1 and name != "objects":
            own = np.flip(own, flips)
            own = np.ascontiguousarray(own.swapaxes(-1, -2) if is_transposed else own)
        part[name] = own
    return part


def _on_device(batch: Batch) -> Batch:
    inputs = [values.to(DEVICE, non_blocking=True) for values in batch.inputs]
    return Batch(inputs, *(values.to(DEVICE, non_blocking=True) for values in batch[1:]))


def _read(file: Path) -> Example:
    with np.load(file) as parts:
        return dict(parts)


def _plane_count(file: Path) -> int:
    with np.load(file) as parts, parts.zip.open("evidence.npy") as stream:
        np.lib.format.read_magic(stream)
        return np.lib.format.read_array_header_1_0(stream)[0][0]


def _is_held_out(file: Path) -> bool:
    """Whether an example is kept for the curve; all of a dataset are, or none."""
    return zlib.crc32(file.stem.rsplit("_", 1)[0].encode()) % HELD_OUT == 0

"""Batches of examples: parts of films, mirrored and transposed at random, each with a request of its own.

Examples are on the device that trains if half of its free memory holds them, else in memory, else mapped from
their files.
"""

import os
import zlib
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from torch import Tensor  # pyright: ignore[reportMissingImports]

from pcii.base import Report, silent
from pcii.depth import NetworkInputs, hint_of
from pcii.depth.surface_network import MULTIPLE
from training.examples import PIXELS, SAMPLES_PER_BLOCK, read_example, window
from training.requests import draw_request

HELD_OUT = 24
"""One dataset in this many is not trained on."""
MAX_VALUES = {"cpu": 3_000_000, "cuda": 24_000_000}
"""Largest number of blocks times planes of a step."""
BYTES_PER_VALUE = 500
"""Memory of a step for each of them, with a margin: the network keeps 174 for its way back."""
SIDES = (96, 128, 192, 256)
"""Blocks along the sides of the parts of films; those of a step are alike. Narrow things are learned from
many small parts, wide ones and empty film from whole films."""
WAITING_BATCHES = 8
"""Batches that are ready before their step."""
DEVICE = "cuda" if torch.cuda.is_available() else "cpu"


class Batch(NamedTuple):
    """Inputs of B examples with as many planes, and what is true of them, on the device.

    `plane` (B, h, w) is the true plane as a fraction, NaN where there is none; `planes` (B, R) are requested
    ones, NaN beyond an example's own; `target` (B, h, w) is a number of these, R for none, or `NOT_COUNTED`.
    """

    inputs: list[Tensor]
    plane: Tensor
    planes: Tensor
    target: Tensor


class Examples:
    """Examples of a folder, by their numbers; those of a kind of scene, and those with as many planes."""

    def __init__(self, folder: Path, report: Report = silent) -> None:
        files, self.parts = sorted(folder.glob("*.npy")), list[dict[str, Tensor]]()
        size, free, self.max_values = sum(file.stat().st_size for file in files), 0, MAX_VALUES[DEVICE]
        if DEVICE == "cuda":
            free = torch.cuda.mem_get_info()[0]
        is_on_device = size < free / 2
        if free:
            free -= is_on_device * size
            self.max_values = min(self.max_values, int(0.8 * free / BYTES_PER_VALUE))
        is_mapped = size > 0.7 * os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        self.held_out = list[int]()
        self.of_kind, self.of_planes = dict[str, list[int]](), dict[int, list[int]]()
        for number, file in enumerate(files):
            example = read_example(file, is_mapped=is_mapped and not is_on_device)
            parts = {name: torch.from_numpy(values) for name, values in example.items()}
            on_device = SAMPLES_PER_BLOCK if is_on_device else ()
            self.parts.append(parts | {name: parts[name].to(DEVICE) for name in on_device})
            if _is_held_out(file):
                self.held_out.append(number)
            else:
                kind = file.stem.split("_draw_")[0].split("scene_")[-1]
                self.of_kind.setdefault(kind, []).append(number)
                self.of_planes.setdefault(len(example["evidence"]), []).append(number)
            report("examples read", number + 1, len(files))

    def draw_batches(self, rng: np.random.Generator, pool: ThreadPoolExecutor) -> Iterator[Batch]:
        """Batches without end: an example of any kind of scene, all kinds alike, and others of as many
        planes."""
        kinds, waiting = list(self.of_kind.values()), deque[Future[Batch]]()
        while True:
            while len(waiting) < WAITING_BATCHES:
                kind = kinds[rng.integers(len(kinds))]
                first = kind[rng.integers(len(kind))]
                planes = len(self.parts[first]["evidence"])
                side = min(SIDES[rng.integers(len(SIDES))], int((self.max_values / planes) ** 0.5))
                count = max(1, self.max_values // (planes * side**2))
                alike = self.of_planes[planes]
                numbers = [first, *(alike[at] for at in rng.integers(len(alike), size=count - 1))]
                waiting.append(pool.submit(self.batch, numbers, side, rng.spawn(1)[0]))
            yield waiting.popleft().result()

    def batch(self, numbers: Sequence[int], side: int, rng: np.random.Generator) -> Batch:
        """Square parts of examples, `side` blocks wide or as wide as the narrowest of their films."""
        examples = [self.parts[number] for number in numbers]
        sides = (size for each in examples for size in each["evidence"].shape[1:])
        side = max(min(side, *sides) // MULTIPLE, 1) * MULTIPLE
        plane_count = len(examples[0]["evidence"])
        parts = [_draw_part(example, side, rng) for example in examples]
        requests = [
            draw_request(each["objects"].numpy(), each["named_planes"].numpy(), plane_count, rng)
            for each in examples
        ]
        most = max(request.planes.size for request in requests)
        planes, targets = np.full((len(numbers), most), np.nan, np.float32), []
        for row, part, request in zip(planes, parts, requests, strict=True):
            row[: request.planes.size] = request.planes
            of_number = np.where(request.targets == request.planes.size, most, request.targets)
            targets.append(torch.from_numpy(of_number).to(DEVICE)[part["object_number"].long()])
        names = NetworkInputs._fields[:-1]
        hints = np.stack([hint_of(plane_count, request.planes) for request in requests])
        inputs = [torch.stack([part[name] for part in parts]).float() for name in names]
        inputs.append(torch.from_numpy(hints).to(DEVICE))
        plane = torch.stack([part["plane"] for part in parts])
        return Batch(inputs, plane, torch.from_numpy(planes).to(DEVICE), torch.stack(targets))


def _draw_part(example: dict[str, Tensor], side: int, rng: np.random.Generator) -> dict[str, Tensor]:
    """The maps of a square part of an example, `side` blocks wide, on the device; of the truth a random pixel
    of each block."""
    h, w = example["evidence"].shape[1:]
    top, left = (2 * int(rng.integers(0, (size - side) // 2 + 1)) for size in (h, w))
    down, right = rng.integers(0, PIXELS, 2).tolist()
    flips = [axis for axis in (-1, -2) if rng.random() < 0.5]
    is_transposed = rng.random() < 0.5
    part = {"light": example["light"].to(DEVICE)}
    for name in SAMPLES_PER_BLOCK:
        values = window(name, example[name], top, left, side)
        if SAMPLES_PER_BLOCK[name] == PIXELS:
            values = values[down::PIXELS, right::PIXELS]
        values = values.to(DEVICE, non_blocking=True).flip(flips)
        part[name] = values.mT if is_transposed else values
    return part


def _is_held_out(file: Path) -> bool:
    """Whether an example is kept for the curve; all of a dataset are, or none."""
    return zlib.crc32(file.stem.rsplit("_", 1)[0].encode()) % HELD_OUT == 0

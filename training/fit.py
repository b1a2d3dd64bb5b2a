"""Train the network of depth, on a GPU where there is one.

    python -m training.fit EXAMPLES --out weights.pt --minutes 90 [--resume]

EXAMPLES is a folder made by `training.samples`. The objective is the cross-entropy of the true plane: for
each block of 2 px the negative logarithm of the probability of the two planes beside the true depth, by how
near they are, or of no surface. Examples are cut, mirrored and transposed at random. One dataset in
`HELD_OUT` is kept for the curve that is printed: minutes, steps, cross-entropy in training and of what is
held out, and the share of surfaces there that are off by more than one plane, of the network and of the
smooth surface that it is given. With each line of it the state is written beside the weights, from which
`--resume` goes on.
"""

import argparse
import copy
import csv
import time
import zlib
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from pcii.depth.network_inputs import NetworkInputs
from pcii.depth.surface_network import MULTIPLE
from training.layers import DepthNetwork

HELD_OUT = 24
"""One dataset in so many is not trained on."""
MOST_VALUES = {"cpu": 900_000, "cuda": 2_600_000}
"""Blocks times planes of the part of an example that is used at once."""
LEAST_SIDE = 96
BATCH = 4
"""Examples of a step."""
MADE_AHEAD = 8
"""Batches that wait for their step."""
RATE, WARM_UP, DECAY = 1.5e-3, 0.02, 1e-4
"""Largest step, share of the time in which it rises to it, weight decay."""
AVERAGE = 0.998
NO_SURFACE = 0.5
"""Weight of blocks without a surface."""
CURVE_ROWS = 10
DEVICE = "cuda" if torch.cuda.is_available() else "cpu"
INPUTS = NetworkInputs._fields

Example = dict[str, Tensor]
Batch = tuple[list[Tensor], Tensor]
"""Inputs of examples with as many planes, and their true planes."""


def main() -> None:
    """Train as the command line says."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("examples", type=Path)
    parser.add_argument("--out", required=True, type=Path)
    parser.add_argument(
        "--minutes", type=float, required=True, help="in all, those before it was resumed too"
    )
    parser.add_argument("--resume", action="store_true", help="go on from the state beside the weights")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    torch.manual_seed(arguments.seed)
    training = Training(arguments.out)
    if arguments.resume:
        if not training.state.is_file():
            parser.error(f"--resume: there is no state {training.state}; leave it out to begin")
        training.resume()
    training.fit(arguments.examples, arguments.minutes, arguments.threads, arguments.seed)


class Training:
    """The network, the mean of its recent weights, and how far its training has come."""

    def __init__(self, out: Path) -> None:
        self.network = DepthNetwork().to(DEVICE, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.averaged = copy.deepcopy(self.network)
        self.optimizer = torch.optim.AdamW(
            self.network.parameters(), lr=RATE, weight_decay=DECAY, betas=(0.9, 0.99)
        )
        self.steps, self.minutes = 0, 0.0
        self.weights, self.state = out, out.with_suffix(".state")
        self.curve = [["minutes", "steps", "training_nats", "held_out_nats", "off", "off_of_surface"]]

    def fit(self, folder: Path, minutes: float, threads: int, seed: int) -> None:
        """Train until it took so many minutes in all; writes weights, state and curve from time to time."""
        rng = np.random.default_rng((seed, self.steps))
        start, losses = time.monotonic() - 60 * self.minutes, list[Tensor]()
        with ThreadPoolExecutor(threads) as pool:
            examples = Examples(folder, pool)
            batches = examples.batches(rng, pool)
            while (minute := (time.monotonic() - start) / 60) < minutes:
                done = minute / minutes
                for group in self.optimizer.param_groups:
                    group["lr"] = float(
                        RATE * min(1, done / WARM_UP) * (0.5 + 0.5 * np.cos(np.pi * done)) + 1e-6
                    )
                losses.append(self._step(next(batches)))
                if minute >= self.minutes + minutes / CURVE_ROWS:
                    self.minutes = minute
                    self._write(losses, examples)
                    losses.clear()
            self.minutes = minutes
            self._write(losses, examples)

    def resume(self) -> None:
        """Go on from the state that was written beside the weights."""
        state = torch.load(self.state, weights_only=True, map_location=DEVICE)
        self.network.load_state_dict(state["network"])
        self.averaged.load_state_dict(state["averaged"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.steps, self.minutes, self.curve = state["steps"], state["minutes"], state["curve"]

    def _step(self, batch: Batch) -> Tensor:
        """One step of the optimiser; gives the mean loss."""
        self.optimizer.zero_grad()
        inputs, plane = batch
        # Twice as fast where the processor has it; weights stay as they are.
        with torch.autocast(DEVICE, torch.bfloat16):
            result = self.network(*inputs)
        loss = cross_entropy(result.float(), plane)
        loss.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimizer.step()
        self.steps += 1
        share = min(AVERAGE, self.steps / (self.steps + 10))
        with torch.no_grad():
            for mean, own in zip(self.averaged.parameters(), self.network.parameters(), strict=True):
                mean.lerp_(own, 1 - share)
        return loss.detach()

    def _write(self, losses: list[Tensor], examples: "Examples") -> None:
        """Write weights, state and curve, and print how it stands."""
        loss = float(torch.stack(losses).mean()) if losses else np.nan
        row = [self.minutes, self.steps, loss, *judged(self.averaged, examples)]
        self.curve.append([f"{value:.4g}" for value in row])
        print("  ".join(self.curve[-1]), flush=True)
        torch.save(self.averaged.state_dict(), self.weights)
        state = {
            "network": self.network.state_dict(),
            "averaged": self.averaged.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "steps": self.steps,
            "minutes": self.minutes,
            "curve": self.curve,
        }
        torch.save(state, self.state)
        with self.weights.with_suffix(".csv").open("w", newline="") as stream:
            csv.writer(stream).writerows(self.curve)


class Examples:
    """Examples of a folder; on a GPU all are kept in its memory."""

    def __init__(self, folder: Path, pool: ThreadPoolExecutor) -> None:
        files = sorted(folder.glob("*.npz"))
        self._kept = dict(zip(files, pool.map(_read, files), strict=True)) if DEVICE == "cuda" else {}
        self.planes = dict(zip(files, pool.map(_plane_count, files), strict=True))
        self.held_out = [file for file in files if _held_out(file)]
        self.kinds: dict[str, list[Path]] = {}
        self.of_planes: dict[int, list[Path]] = {}
        for file in files:
            if not _held_out(file):
                self.kinds.setdefault(file.stem.split("_draw_")[0].split("scene_")[-1], []).append(file)
                self.of_planes.setdefault(self.planes[file], []).append(file)

    def batches(self, rng: np.random.Generator, pool: ThreadPoolExecutor) -> Iterator[Batch]:
        """Batches without end, made ahead of their use, of examples with as many planes.

        How many is that of one of a kind of scene, all kinds alike.
        """
        kinds, waiting = list(self.kinds.values()), deque[Future[Batch]]()
        while True:
            while len(waiting) < MADE_AHEAD:
                kind = kinds[rng.integers(len(kinds))]
                alike = self.of_planes[self.planes[kind[rng.integers(len(kind))]]]
                chosen = [alike[place] for place in rng.integers(len(alike), size=BATCH)]
                waiting.append(pool.submit(self.batch, chosen, np.random.default_rng(rng.integers(2**32))))
            yield waiting.popleft().result()

    def batch(self, files: list[Path], rng: np.random.Generator) -> Batch:
        """Inputs and true planes (B, h, w) of square parts of examples, mirrored and transposed at random."""
        examples = [self._kept[file] if self._kept else _read(file) for file in files]
        side = max(LEAST_SIDE, int(np.sqrt(MOST_VALUES[DEVICE] / self.planes[files[0]])))
        sides = (size for each in examples for size in each["evidence"].shape[1:])
        side = min(side, *sides) // MULTIPLE * MULTIPLE
        parts = [_part(example, side, rng) for example in examples]
        stacked = {name: torch.stack([part[name] for part in parts]).float() for name in (*INPUTS, "plane")}
        return [stacked[name] for name in INPUTS], stacked["plane"]


def _part(example: Example, side: int, rng: np.random.Generator) -> Example:
    """A square part of an example, so many blocks wide, mirrored and transposed at random."""
    h, w = example["evidence"].shape[1:]
    top, left = (2 * int(rng.integers(0, (size - side) // 2 + 1)) for size in (h, w))
    pixel = rng.integers(0, 2, 2)
    flips = [axis for axis in (-1, -2) if rng.random() < 0.5]
    transposed = rng.random() < 0.5
    result = {}
    for name, values in example.items():
        part = values
        if values.ndim > 1:
            size = 2 if name in ("coverage", "surface") else 1
            own = values[..., pixel[0] :: 2, pixel[1] :: 2] if name == "plane" else values
            part = own[..., top // size : (top + side) // size, left // size : (left + side) // size]
            part = torch.flip(part, flips)
            part = part.transpose(-1, -2) if transposed else part
        result[name] = part
    return result


def _read(file: Path) -> Example:
    with np.load(file) as parts:
        return {name: torch.from_numpy(parts[name]).to(DEVICE) for name in (*INPUTS, "plane")}


def _plane_count(file: Path) -> int:
    with np.load(file) as parts, parts.zip.open("evidence.npy") as stream:
        np.lib.format.read_magic(stream)
        return np.lib.format.read_array_header_1_0(stream)[0][0]


def _held_out(file: Path) -> bool:
    """Whether an example is kept for the curve; all of a dataset are, or none."""
    return zlib.crc32(file.stem.rsplit("_", 1)[0].encode()) % HELD_OUT == 0


def cross_entropy(log_probability: Tensor, plane: Tensor) -> Tensor:
    """Mean cross-entropy in nats of log-probabilities (B, Z + 1, h, w); true planes (B, h, w) or NaN."""
    Z = log_probability.shape[1] - 1
    none = torch.isnan(plane)
    place = torch.where(none, 0.0, plane).clamp(0, Z - 1)
    lower = place.floor().long().clamp(max=Z - 2)
    upper_share = place - lower
    planes = [log_probability.gather(1, (lower + step)[:, None])[:, 0] for step in (0, 1)]
    surface = -(1 - upper_share) * planes[0] - upper_share * planes[1]
    weight = torch.where(none, NO_SURFACE, 1.0)
    return (torch.where(none, -log_probability[:, -1], surface) * weight).sum() / weight.sum()


def judged(network: DepthNetwork, examples: Examples) -> tuple[float, float, float]:
    """Cross-entropy of the examples held out, and shares of surfaces off by more than a plane, of both."""
    rows = []
    for file in examples.held_out:
        inputs, plane = examples.batch([file], np.random.default_rng(0))
        with torch.no_grad(), torch.autocast(DEVICE, torch.bfloat16):
            result = network(*inputs).float()
        surface = nn.functional.interpolate(inputs[3], scale_factor=2.0)
        inside = ~torch.isnan(plane)
        off = [
            ((found.argmax(1) - plane).abs() > 1)[inside].float().mean().item() if inside.any() else np.nan
            for found in (result[:, :-1], surface)
        ]
        rows.append((cross_entropy(result, plane).item(), *off))
    return tuple(np.nanmean(rows, axis=0)) if rows else (np.nan,) * 3


if __name__ == "__main__":
    main()

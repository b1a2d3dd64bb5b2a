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
MOST_VALUES = {"cpu": 900_000, "cuda": 2_600_000}
"""Blocks times planes of the part of an example that is used at once."""
LEAST_SIDE = 96
BATCH = 4
"""Examples of a step."""
LOADED_AHEAD = 16
RATE, WARM_UP, DECAY = 1.5e-3, 0.02, 1e-4
"""Largest step, share of the time in which it rises to it, weight decay."""
AVERAGE = 0.998
NO_SURFACE = 0.5
"""Weight of blocks without a surface."""
CURVE_ROWS = 10
DEVICE = "cuda" if torch.cuda.is_available() else "cpu"
INPUTS = NetworkInputs._fields

Example = tuple[list[Tensor], Tensor]


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
        self.steps, self.minutes, self.out = 0, 0.0, out
        self.curve = [["minutes", "steps", "training_nats", "held_out_nats", "off", "off_of_surface"]]

    def fit(self, folder: Path, minutes: float, threads: int, seed: int) -> None:
        """Train until it took so many minutes in all; writes weights, state and curve from time to time."""
        rng = np.random.default_rng((seed, self.steps))
        start, losses = time.monotonic() - 60 * self.minutes, list[float]()
        with ThreadPoolExecutor(threads) as pool:
            examples = _examples(by_scene(folder), rng, pool)
            while (minute := (time.monotonic() - start) / 60) < minutes:
                done = minute / minutes
                for group in self.optimizer.param_groups:
                    group["lr"] = float(
                        RATE * min(1, done / WARM_UP) * (0.5 + 0.5 * np.cos(np.pi * done)) + 1e-6
                    )
                losses.append(self._step([next(examples) for _ in range(BATCH)]))
                if minute >= self.minutes + minutes / CURVE_ROWS:
                    self.minutes = minute
                    self._write(float(np.mean(losses)), folder)
                    losses.clear()
            self.minutes = minutes
            self._write(float(np.mean(losses)) if losses else np.nan, folder)

    def resume(self) -> None:
        """Go on from the state that was written beside the weights."""
        state = torch.load(self.out.with_suffix(".state"), weights_only=True, map_location=DEVICE)
        self.network.load_state_dict(state["network"])
        self.averaged.load_state_dict(state["averaged"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.steps, self.minutes, self.curve = state["steps"], state["minutes"], state["curve"]

    def _step(self, batch: list[Example]) -> float:
        """One step of the optimiser; gives the mean loss."""
        self.optimizer.zero_grad()
        total = torch.zeros((), device=DEVICE)
        for inputs, plane in batch:
            # Twice as fast where the processor has it; weights stay as they are.
            with torch.autocast(DEVICE, torch.bfloat16):
                result = self.network(*(_on_device(part) for part in inputs))
            loss = cross_entropy(result.float(), _on_device(plane)) / len(batch)
            loss.backward()
            total += loss.detach()
        nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimizer.step()
        self.steps += 1
        share = min(AVERAGE, self.steps / (self.steps + 10))
        with torch.no_grad():
            torch._foreach_lerp_(list(self.averaged.parameters()), list(self.network.parameters()), 1 - share)
        return float(total)

    def _write(self, loss: float, folder: Path) -> None:
        """Write weights, state and curve, and print how it stands."""
        row = [self.minutes, self.steps, loss, *judged(self.averaged, folder)]
        self.curve.append([f"{value:.4g}" for value in row])
        print("  ".join(self.curve[-1]), flush=True)
        torch.save(self.averaged.state_dict(), self.out)
        state = {
            "network": self.network.state_dict(),
            "averaged": self.averaged.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "steps": self.steps,
            "minutes": self.minutes,
            "curve": self.curve,
        }
        torch.save(state, self.out.with_suffix(".state"))
        with self.out.with_suffix(".csv").open("w", newline="") as stream:
            csv.writer(stream).writerows(self.curve)


def _examples(
    kinds: list[list[Path]], rng: np.random.Generator, pool: ThreadPoolExecutor
) -> Iterator[Example]:
    """Parts of examples without end, all kinds of scene alike, loaded ahead of their use."""
    waiting = deque[Future[Example]]()
    while True:
        while len(waiting) < LOADED_AHEAD:
            files = kinds[rng.integers(len(kinds))]
            file, own = files[rng.integers(len(files))], np.random.default_rng(rng.integers(2**32))
            waiting.append(pool.submit(loaded, file, own))
        yield waiting.popleft().result()


def _on_device(values: Tensor) -> Tensor:
    return values.to(DEVICE, torch.float32, non_blocking=True)


def by_scene(folder: Path) -> list[list[Path]]:
    """The examples to train on, those of one kind of scene together."""
    kinds: dict[str, list[Path]] = {}
    for file in sorted(folder.glob("*.npz")):
        if not held_out(file):
            kinds.setdefault(file.stem.split("_draw_")[0].split("scene_")[-1], []).append(file)
    return list(kinds.values())


def held_out(file: Path) -> bool:
    """Whether an example is kept for the curve; all of a dataset are, or none."""
    return zlib.crc32(file.stem.rsplit("_", 1)[0].encode()) % HELD_OUT == 0


def loaded(file: Path, rng: np.random.Generator) -> Example:
    """The inputs and the true plane (h, w) of a part of an example, mirrored and transposed at random."""
    with np.load(file) as parts:
        arrays = {name: parts[name] for name in (*INPUTS, "plane")}
    Z, h, w = arrays["evidence"].shape
    side = max(LEAST_SIDE, int(np.sqrt(MOST_VALUES[DEVICE] / Z)) // MULTIPLE * MULTIPLE)
    rows, columns = (min(side, size // MULTIPLE * MULTIPLE) for size in (h, w))
    top, left = (2 * int(rng.integers(0, (size - used) // 2 + 1)) for size, used in ((h, rows), (w, columns)))
    pixel = rng.integers(0, 2, 2)
    arrays["plane"] = arrays["plane"][pixel[0] :: 2, pixel[1] :: 2]
    flips = [axis for axis in (-1, -2) if rng.random() < 0.5]
    transposed = rng.random() < 0.5
    for name, values in arrays.items():
        if values.ndim > 1:
            size = 2 if name in ("coverage", "surface") else 1
            part = values[..., top // size : (top + rows) // size, left // size : (left + columns) // size]
            part = np.flip(part, flips)
            arrays[name] = np.ascontiguousarray(part.swapaxes(-1, -2) if transposed else part)
    return [torch.from_numpy(arrays[name]) for name in INPUTS], torch.from_numpy(arrays["plane"])


def cross_entropy(log_probability: Tensor, plane: Tensor) -> Tensor:
    """Mean cross-entropy in nats of log-probabilities (Z + 1, h, w), for true planes (h, w), NaN for none."""
    Z = log_probability.shape[0] - 1
    none = torch.isnan(plane)
    place = torch.where(none, 0.0, plane).clamp(0, Z - 1)
    lower = place.floor().long().clamp(max=Z - 2)
    upper_share = place - lower
    planes = [log_probability.gather(0, (lower + step)[None])[0] for step in (0, 1)]
    surface = -(1 - upper_share) * planes[0] - upper_share * planes[1]
    weight = torch.where(none, NO_SURFACE, 1.0)
    return (torch.where(none, -log_probability[-1], surface) * weight).sum() / weight.sum()


def judged(network: DepthNetwork, folder: Path) -> tuple[float, float, float]:
    """Cross-entropy of the examples held out, and shares of surfaces off by more than a plane, of both."""
    rows = []
    for file in sorted(folder.glob("*.npz")):
        if not held_out(file):
            continue
        parts, plane = loaded(file, np.random.default_rng(0))
        inputs, plane = [_on_device(part) for part in parts], _on_device(plane)
        with torch.no_grad(), torch.autocast(DEVICE, torch.bfloat16):
            result = network(*inputs).float()
        surface = torch.nn.functional.interpolate(inputs[3][:, None], scale_factor=2.0)[:, 0]
        inside = ~torch.isnan(plane)
        off = [
            ((found.argmax(0) - plane).abs() > 1)[inside].float().mean().item() if inside.any() else np.nan
            for found in (result[:-1], surface)
        ]
        rows.append((cross_entropy(result, plane).item(), *off))
    return tuple(np.nanmean(rows, axis=0)) if rows else (np.nan,) * 3


if __name__ == "__main__":
    main()

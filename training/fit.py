"""Train the network of depth.

    python -m training.fit EXAMPLES --out weights.pt --minutes 90 [--start weights.pt]

EXAMPLES is a folder made by `training.samples`. The objective is the cross-entropy of the true plane: for
each block of 2 px the negative logarithm of the probability of the two planes beside the true depth, by how
near they are, or of no surface. Examples are cut, mirrored and transposed at random. One in `HELD_OUT` is
kept for the curve that is printed: minutes, steps, cross-entropy in training and of what is held out, and the
share of surfaces there that are off by more than one plane, of the network and of the smooth surface that it
is given.
"""

import argparse
import copy
import csv
import time
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from pcii.depth.network_inputs import NetworkInputs
from pcii.depth.surface_network import MULTIPLE
from training.layers import DepthNetwork

HELD_OUT = 12
MOST_VALUES = 900_000
"""Blocks times planes of the part of an example that is used at once."""
LEAST_SIDE = 96
RATE, WARM_UP, DECAY = 1.5e-3, 0.02, 1e-4
"""Largest step, share of the time in which it rises to it, weight decay."""
AVERAGE = 0.995
NO_SURFACE = 0.5
"""Weight of blocks without a surface."""
INPUTS = NetworkInputs._fields

Example = tuple[list[Tensor], Tensor]


def main() -> None:
    """Train as the command line says."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("examples", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--minutes", type=float, required=True)
    parser.add_argument("--start", type=Path, help="weights to go on from")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    torch.manual_seed(arguments.seed)
    network = DepthNetwork().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    if arguments.start:
        network.load_state_dict(torch.load(arguments.start, weights_only=True))
    fit(network, arguments.examples, arguments.out, arguments.minutes, arguments.threads, arguments.seed)


def fit(network: DepthNetwork, folder: Path, out: Path, minutes: float, threads: int, seed: int) -> None:
    """Train for so many minutes, an example on each thread; writes the mean of recent weights every five."""
    rng = np.random.default_rng(seed)
    averaged = copy.deepcopy(network)
    replicas = [copy.deepcopy(network) for _ in range(threads)]
    optimizer = torch.optim.AdamW(network.parameters(), lr=RATE, weight_decay=DECAY, betas=(0.9, 0.99))
    start = shown = time.monotonic()
    steps, losses, files = 0, list[float](), by_scene(folder)
    with ThreadPoolExecutor(threads) as pool, out.with_suffix(".csv").open("w", newline="") as stream:
        curve = csv.writer(stream)
        curve.writerow(["minutes", "steps", "training_nats", "held_out_nats", "off", "off_of_surface"])
        while (done := (time.monotonic() - start) / 60 / minutes) < 1:
            for group in optimizer.param_groups:
                group["lr"] = RATE * min(1, done / WARM_UP) * (0.5 + 0.5 * np.cos(np.pi * done)) + 1e-6
            kinds = [files[rng.integers(len(files))] for _ in replicas]  # all kinds of scene alike
            chosen = [
                (each[rng.integers(len(each))], np.random.default_rng(rng.integers(2**32))) for each in kinds
            ]
            for replica in replicas:
                replica.load_state_dict(network.state_dict())
            losses.extend(pool.map(_accumulate, replicas, chosen))
            for own, *others in zip(
                network.parameters(), *(each.parameters() for each in replicas), strict=True
            ):
                own.grad = torch.stack([p.grad for p in others if p.grad is not None]).mean(0)
            nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimizer.step()
            steps += 1
            share = min(AVERAGE, steps / (steps + 10))
            with torch.no_grad():
                for mean, own in zip(averaged.parameters(), network.parameters(), strict=True):
                    mean.lerp_(own, 1 - share)
            if time.monotonic() - shown > 300 or steps in (20, 100):
                shown = time.monotonic()
                torch.save(averaged.state_dict(), out)
                row = [(shown - start) / 60, steps, float(np.mean(losses)), *judged(averaged, folder, pool)]
                curve.writerow([f"{value:.4g}" for value in row])
                stream.flush()
                print("  ".join(f"{value:.4g}" for value in row), flush=True)
                losses.clear()
    torch.save(averaged.state_dict(), out)
    print("  ".join(f"{value:.4g}" for value in judged(averaged, folder, None)), flush=True)


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
        arrays = {name: parts[name].astype(np.float32) for name in (*INPUTS, "plane")}
    Z, h, w = arrays["evidence"].shape
    side = max(LEAST_SIDE, int(np.sqrt(MOST_VALUES / Z)) // MULTIPLE * MULTIPLE)
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
    place = torch.where(none, torch.tensor(0.0), plane).clamp(0, Z - 1)
    lower = place.floor().long().clamp(max=Z - 2)
    upper_share = place - lower
    planes = [log_probability.gather(0, (lower + step)[None])[0] for step in (0, 1)]
    surface = -(1 - upper_share) * planes[0] - upper_share * planes[1]
    weight = torch.where(none, torch.tensor(NO_SURFACE), torch.tensor(1.0))
    return (torch.where(none, -log_probability[-1], surface) * weight).sum() / weight.sum()


def _accumulate(replica: DepthNetwork, chosen: tuple[Path, np.random.Generator]) -> float:
    torch.set_num_threads(1)
    replica.zero_grad()
    inputs, plane = loaded(*chosen)
    with torch.autocast(
        "cpu", torch.bfloat16
    ):  # twice as fast where the processor has it; weights stay as they are
        result = replica(*inputs)
    loss = cross_entropy(result.float(), plane)
    loss.backward()
    return loss.item()


def judged(
    network: DepthNetwork, folder: Path, pool: ThreadPoolExecutor | None
) -> tuple[float, float, float]:
    """Cross-entropy of the examples held out, and shares of surfaces off by more than a plane, of both."""
    files = [file for file in sorted(folder.glob("*.npz")) if held_out(file)]

    def judge(file: Path) -> tuple[float, float, float]:
        torch.set_num_threads(1)
        inputs, plane = loaded(file, np.random.default_rng(0))
        with torch.no_grad():
            result = network(*inputs)
        surface = torch.nn.functional.interpolate(inputs[3][:, None], scale_factor=2.0)[:, 0]
        inside = ~torch.isnan(plane)
        off = [
            ((found.argmax(0) - plane).abs() > 1)[inside].float().mean().item() if inside.any() else np.nan
            for found in (result[:-1], surface)
        ]
        return cross_entropy(result, plane).item(), off[0], off[1]

    rows = list(map(judge, files) if pool is None else pool.map(judge, files))
    return tuple(np.nanmean(rows, axis=0)) if rows else (np.nan,) * 3


if __name__ == "__main__":
    main()

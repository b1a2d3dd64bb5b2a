"""Train the network of depth and masks on examples, on a GPU where there is one."""

import copy
import csv
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from torch import Tensor, nn  # pyright: ignore[reportMissingImports]

from pcii.base import Report, silent
from training.batches import DEVICE, SIDES, Batch, Examples
from training.layers import SurfaceNetwork
from training.losses import depth_loss, mask_log_probability, mask_loss
from training.requests import NOT_COUNTED

RATE, WARM_UP, DECAY = 1e-3, 0.02, 1e-4
"""Largest step, share of the time in which it rises to it, weight decay."""
AVERAGE = 0.998
"""Share of the former mean in the mean of the recent weights, which is what is written."""
CURVE_ROWS = 10
HALF_PRECISION = torch.autocast(
    DEVICE, torch.bfloat16, DEVICE == "cuda" or torch.backends.cpu.get_cpu_capability() == "AVX512"
)
"""Faster where the processor has it, and six times slower where it has not; weights stay as they are."""
COLUMNS = ("minutes", "steps", "training_nats", "held_out_nats", "masks_nats", "off", "mask_errors")


class Training:
    """A network, the mean of its recent weights, and how far its training has come.

    Weights, state and curve are written to `file` and beside it. A state that is there is gone on from.
    """

    def __init__(self, network: SurfaceNetwork, file: Path) -> None:
        self.network = network.to(DEVICE, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.averaged = copy.deepcopy(self.network)
        self.optimizer = torch.optim.AdamW(
            self.network.parameters(), lr=RATE, weight_decay=DECAY, betas=(0.9, 0.99)
        )
        self.file, self.state_file = file, file.with_suffix(".state")
        self.steps, self.minutes = 0, 0.0
        if self.state_file.is_file():
            state = torch.load(self.state_file, weights_only=True, map_location=DEVICE)
            self.network.load_state_dict(state["network"])
            self.averaged.load_state_dict(state["averaged"])
            self.optimizer.load_state_dict(state["optimizer"])
            self.steps, self.minutes = state["steps"], state["minutes"]

    def fit(self, examples: Examples, minutes: float, threads: int = 1, report: Report = silent) -> None:
        """Train until it took `minutes` in all; writes weights, state and curve from time to time."""
        rng, losses, before = np.random.default_rng((0, self.steps)), list[Tensor](), self.minutes
        start, written = time.monotonic(), self.minutes
        with ThreadPoolExecutor(threads) as pool:
            batches = examples.draw_batches(rng, pool)
            if not self.steps:
                self._write(losses, examples)
            while self.minutes < minutes:
                losses.append(self.step(next(batches), self.minutes / minutes))
                self.minutes = before + (time.monotonic() - start) / 60
                done, total = (round(60 * (end - before)) for end in (self.minutes, minutes))
                report("seconds of training", min(done, total), total)
                if self.minutes >= min(written + minutes / CURVE_ROWS, minutes):
                    written = self.minutes
                    self._write(losses, examples)
                    losses.clear()

    def step(self, batch: Batch, share: float) -> Tensor:
        """One step of the optimiser, after this share of the time; gives the mean loss."""
        rise, fall = min(1, share / WARM_UP), 0.5 + 0.5 * np.cos(np.pi * share)
        for group in self.optimizer.param_groups:
            group["lr"] = float(RATE * rise * fall + 1e-6)
        self.optimizer.zero_grad(set_to_none=True)
        with HALF_PRECISION:
            depth, masks = (part.float() for part in self.network(*batch.inputs))
        loss = depth_loss(depth, batch.plane) + mask_loss(masks, depth, batch.planes, batch.target)
        loss.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimizer.step()
        self.steps += 1
        average = min(AVERAGE, self.steps / (self.steps + 10))
        with torch.no_grad():
            for mean, weight in zip(self.averaged.parameters(), self.network.parameters(), strict=True):
                mean.lerp_(weight, 1 - average)
        return loss.detach()

    def _write(self, losses: list[Tensor], examples: Examples) -> None:
        """Write weights, state and curve, and print how it stands."""
        loss = float(torch.stack(losses).mean()) if losses else np.nan
        row = [f"{value:.4g}" for value in (self.minutes, self.steps, loss, *judge(self.averaged, examples))]
        print(", ".join(f"{name} {value}" for name, value in zip(COLUMNS, row, strict=True)), flush=True)
        with self.file.with_suffix(".csv").open("a") as stream:
            csv.writer(stream).writerows([row] if stream.tell() else [COLUMNS, row])
        torch.save(self.averaged.state_dict(), self.file)
        state = {name: getattr(self, name).state_dict() for name in ("network", "averaged", "optimizer")}
        unfinished = self.state_file.with_suffix(".new")
        torch.save(state | {"steps": self.steps, "minutes": self.minutes}, unfinished)
        unfinished.replace(self.state_file)


def judge(network: SurfaceNetwork, examples: Examples) -> np.ndarray:
    """Of the examples held out: both cross-entropies, shares of surfaces off by more than a plane and of
    wrong masks; NaN without such examples."""
    rows = []
    for number in examples.held_out:
        batch = examples.batch([number], max(SIDES), np.random.default_rng(0))
        with torch.no_grad(), HALF_PRECISION:
            depth, masks = (part.float() for part in network(*batch.inputs))
        is_surface, is_counted = ~torch.isnan(batch.plane), batch.target != NOT_COUNTED
        off = ((depth[:, :-1].argmax(1) - batch.plane).abs() > 1)[is_surface].float().mean()
        of_masks = wrong = torch.tensor(torch.nan)
        if is_counted.any():
            of_masks = mask_loss(masks, depth, batch.planes, batch.target)
            label = mask_log_probability(masks, depth, batch.planes).argmax(1)
            wrong = (label != batch.target)[is_counted].float().mean()
        losses = depth_loss(depth, batch.plane), of_masks, off, wrong
        rows.append([value.item() for value in losses])
    return np.nanmean(rows, axis=0) if rows else np.full(4, np.nan)

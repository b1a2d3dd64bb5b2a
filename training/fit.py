"""Train the network of depth and masks, on a GPU where there is one.

    python -m training.fit EXAMPLES --out weights.pt --minutes 90 [--resume] [--anew] [--masks]

EXAMPLES is a folder made by `training.samples`. Training starts from the weights that ship, or with `--anew`
from random ones. The objective is the sum of two cross-entropies, in nats per block of 2 px: of the true
plane, minus the logarithm of the probability of the two planes beside the true depth, by how near they are,
or of no surface; and of the requested plane that the block's object belongs to, or none of them. One dataset
in `HELD_OUT` is kept for the curve that is printed. With each line of it the state is written beside the
weights, from which `--resume` goes on.

With `--masks` only the layers that read the request and that say masks are trained, which a processor can do
in an hour; depth without a request stays as it is.
"""

import argparse
import copy
import csv
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from pcii.depth.surface_network import MIN_NEAR, WEIGHTS, requested_weights
from training.examples import DEVICE, SIDES, Batch, Examples
from training.layers import SurfaceNetwork
from training.requests import NOT_COUNTED

RATE, WARM_UP, DECAY = 1e-3, 0.02, 1e-4
"""Largest step, share of the time in which it rises to it, weight decay."""
MASKS_RATE = 3e-3
"""The same of layers for requests and masks alone, which have some 100 weights."""
AVERAGE = 0.998
NO_SURFACE_WEIGHT = 0.5
CURVE_ROWS = 10
HALF_PRECISION = torch.autocast(
    DEVICE, torch.bfloat16, DEVICE == "cuda" or torch.backends.cpu.get_cpu_capability() == "AVX512"
)
"""Faster where the processor has it, and six times slower where it has not; weights stay as they are."""
COLUMNS = ("minutes", "steps", "training_nats", "held_out_nats", "masks_nats", "off", "mask_errors")


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
    parser.add_argument("--anew", action="store_true", help="start from random weights")
    parser.add_argument("--masks", action="store_true", help="train the layers for requests and masks alone")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    torch.manual_seed(arguments.seed)
    training = Training(arguments.out, only_masks=arguments.masks)
    if arguments.resume:
        if not training.state.is_file():
            parser.error(f"--resume: there is no state {training.state}; leave it out to begin")
        training.resume()
    elif not arguments.anew:
        training.load_exported()
    training.fit(arguments.examples, arguments.minutes, arguments.threads, arguments.seed)


class Training:
    """The network, the mean of its recent weights, and how far its training has come."""

    def __init__(self, out: Path, *, only_masks: bool = False) -> None:
        self.network = SurfaceNetwork().to(DEVICE, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.averaged = copy.deepcopy(self.network)
        self.rate = MASKS_RATE if only_masks else RATE
        for name, weights in self.network.named_parameters():
            weights.requires_grad_(not only_masks or "hint" in name or "mask" in name)
        trained = [weights for weights in self.network.parameters() if weights.requires_grad]
        self.optimizer = torch.optim.AdamW(trained, lr=self.rate, weight_decay=DECAY, betas=(0.9, 0.99))
        self.steps, self.minutes = 0, 0.0
        self.weights, self.state = out, out.with_suffix(".state")
        self.curve = [list(COLUMNS)]

    def load_exported(self) -> None:
        """Start from the weights that ship."""
        self.network.load_exported(WEIGHTS)
        self.averaged.load_state_dict(self.network.state_dict())

    def fit(self, folder: Path, minutes: float, threads: int, seed: int) -> None:
        """Train until it took `minutes` in all; writes weights, state and curve from time to time."""
        rng = np.random.default_rng((seed, self.steps))
        start, losses = time.monotonic() - 60 * self.minutes, list[Tensor]()
        with ThreadPoolExecutor(threads) as pool:
            examples = Examples(folder, pool)
            batches = examples.batches(rng, pool)
            if not self.steps:
                self._write(losses, examples)
            while (minute := (time.monotonic() - start) / 60) < minutes:
                share = minute / minutes
                for group in self.optimizer.param_groups:
                    rise, fall = min(1, share / WARM_UP), 0.5 + 0.5 * np.cos(np.pi * share)
                    group["lr"] = float(self.rate * rise * fall + 1e-6)
                losses.append(self._step(next(batches)))
                if minute >= self.minutes + minutes / CURVE_ROWS:
                    self.minutes = minute
                    self._write(losses, examples)
                    losses.clear()
                    examples = Examples(folder, pool)  # more may have been made in the meantime
                    batches = examples.batches(rng, pool)
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
        self.optimizer.zero_grad(set_to_none=True)
        with HALF_PRECISION:
            depth, masks = self.network(*batch.inputs)
        loss = depth_loss(depth.float(), batch.plane) + mask_loss(masks.float(), depth.float(), batch)
        loss.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimizer.step()
        self.steps += 1
        share = min(AVERAGE, self.steps / (self.steps + 10))
        with torch.no_grad():
            for mean, own in zip(self.averaged.parameters(), self.network.parameters(), strict=True):
                mean.lerp_(own, 1 - share)
        return loss.detach()

    def _write(self, losses: list[Tensor], examples: Examples) -> None:
        """Write weights, state and curve, and print how it stands."""
        loss = float(torch.stack(losses).mean()) if losses else np.nan
        row = [self.minutes, self.steps, loss, *judge(self.averaged, examples)]
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


def depth_loss(log_probability: Tensor, plane: Tensor) -> Tensor:
    """Mean cross-entropy in nats of log-probabilities (B, Z + 1, h, w); true planes (B, h, w) or NaN."""
    Z = log_probability.shape[1] - 1
    is_empty = torch.isnan(plane)
    place = torch.where(is_empty, 0.0, plane).clamp(0, Z - 1)
    lower = place.floor().long().clamp(max=Z - 2)
    upper_share = place - lower
    planes = [log_probability.gather(1, (lower + step)[:, None])[:, 0] for step in (0, 1)]
    surface = -(1 - upper_share) * planes[0] - upper_share * planes[1]
    weight = torch.where(is_empty, NO_SURFACE_WEIGHT, 1.0)
    return (torch.where(is_empty, -log_probability[:, -1], surface) * weight).sum() / weight.sum()


def mask_log_probability(masks: Tensor, depth: Tensor, planes: Tensor) -> Tensor:
    """Log-probabilities (B, R + 1, h, w) of belonging to the requested `planes` (B, R), last to none.

    `masks` (B, Z, h, w) are logits, between planes interpolated linearly, that are added to the logarithms of
    the probabilities of depths near the planes, of the log-probabilities `depth` (B, Z + 1, h, w) without a
    request.
    """
    Z = masks.shape[1]
    is_missing = torch.isnan(planes)
    place = torch.where(is_missing, 0.0, planes)
    lower = place.floor().long().clamp(0, Z - 2)
    upper_share = (place - lower)[:, :, None, None]
    film = torch.arange(len(masks), device=masks.device)[:, None]
    logits = (1 - upper_share) * masks[film, lower] + upper_share * masks[film, lower + 1]
    weights = torch.stack([torch.from_numpy(requested_weights(Z, each)) for each in planes.cpu().numpy()])
    probability = depth[:, :-1].detach().exp()
    sums = torch.einsum("brz,bzhw->brhw", weights.to(masks), probability)
    of_planes = sums[:, :-1] * (probability.sum(dim=1, keepdim=True) / sums[:, -1:].clamp(min=1e-30))
    of_none = (1 - of_planes.sum(dim=1, keepdim=True)).clamp(min=0)
    logits = (logits + (of_planes + MIN_NEAR).log()).masked_fill(is_missing[:, :, None, None], -1e4)
    return torch.log_softmax(torch.cat([logits, (of_none + MIN_NEAR).log()], dim=1), dim=1)


def mask_loss(masks: Tensor, depth: Tensor, batch: Batch) -> Tensor:
    """Mean cross-entropy in nats of masks, over blocks that count; 0 if there are none."""
    is_counted = batch.target != NOT_COUNTED
    if not is_counted.any():
        return 0 * masks.sum()
    log_probability = mask_log_probability(masks, depth, batch.planes)
    own = log_probability.gather(1, batch.target.clamp(min=0)[:, None])[:, 0]
    return -own[is_counted].mean()


def judge(network: SurfaceNetwork, examples: Examples) -> np.ndarray:
    """Of the examples held out: both cross-entropies, shares of surfaces off by more than a plane and of
    wrong masks."""
    rows = []
    for file in examples.held_out:
        batch = examples.batch([file], max(SIDES), np.random.default_rng(0))
        batch = Batch([values.to(DEVICE) for values in batch.inputs], *(v.to(DEVICE) for v in batch[1:]))
        with torch.no_grad(), HALF_PRECISION:
            depth, masks = (part.float() for part in network(*batch.inputs))
        is_surface, is_counted = ~torch.isnan(batch.plane), batch.target != NOT_COUNTED
        off = ((depth[:, :-1].argmax(1) - batch.plane).abs() > 1)[is_surface].float().mean()
        wrong = torch.tensor(torch.nan)
        if is_counted.any():
            label = mask_log_probability(masks, depth, batch.planes).argmax(1)
            wrong = (label != batch.target)[is_counted].float().mean()
        rows.append(
            [
                depth_loss(depth, batch.plane).item(),
                mask_loss(masks, depth, batch).item() if is_counted.any() else np.nan,
                off.item(),
                wrong.item(),
            ]
        )
    return np.nanmean(rows, axis=0) if rows else np.full(4, np.nan)


if __name__ == "__main__":
    main()

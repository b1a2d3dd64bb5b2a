"""The network of depth in PyTorch, and its export.

All planes are treated alike: they are the batch (Z, C, h, w) of two-dimensional convolutions, between which
they exchange features with the planes 1 and 4 steps away and with the largest and the mean over all planes. A
U-net from cells of 4 px up to cells of 64 px sees shapes; a head of blocks of 2 px sees outlines.
"""

from itertools import pairwise

import torch
import torch.nn.functional as f
from torch import Tensor, nn

WIDTHS = (16, 32, 56, 80, 80)
"""Channels of cells of 4, 8, 16, 32 and 64 px."""
HEAD = 8
STEPS = (1, -1, 4, -4)
MOVED = 8
"""One channel in `MOVED` is exchanged by each of the steps."""


def moved(x: Tensor, planes: int) -> Tensor:
    """The features of the plane so many steps before, 0 where there is none."""
    padded = f.pad(x, (0,) * 6 + (max(planes, 0), max(-planes, 0)))
    return padded[: x.shape[0]] if planes > 0 else padded[-planes:]


class Block(nn.Module):
    """Two convolutions added to their input, after an exchange between planes."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.share = width // MOVED
        self.first = nn.Conv2d(width, width, 3, padding=1)
        self.second = nn.Conv2d(width, width, 3, padding=1)
        self.over_planes = nn.Conv2d(2 * width, width, 1)
        nn.init.normal_(self.second.weight, std=0.2 / (3 * width**0.5))
        nn.init.zeros_(self.over_planes.weight)

    def forward(self, x: Tensor) -> Tensor:
        n = self.share
        parts = [moved(x[:, i * n : (i + 1) * n], step) for i, step in enumerate(STEPS)]
        exchanged = torch.cat([*parts, x[:, len(STEPS) * n :]], dim=1)
        over_planes = self.over_planes(torch.cat([x.amax(0, keepdim=True), x.mean(0, keepdim=True)], dim=1))
        return x + self.second(f.relu(self.first(exchanged) + over_planes))


class Trunk(nn.Module):
    """Features (Z, 16, h, w) of cells of 4 px, their logits (Z, 1, h, w), that of no surface (1, 1, h, w)."""

    def __init__(self) -> None:
        super().__init__()
        first = WIDTHS[0]
        self.stem = nn.Conv2d(5, first, 3, padding=1)
        self.down = nn.ModuleList(nn.Conv2d(fine, coarse, 2, stride=2) for fine, coarse in pairwise(WIDTHS))
        self.up = nn.ModuleList(nn.Conv2d(coarse, fine, 1) for fine, coarse in pairwise(WIDTHS))
        self.before = nn.ModuleList(nn.Sequential(Block(width), Block(width)) for width in WIDTHS[1:-1])
        self.coarsest = nn.Sequential(Block(WIDTHS[-1]), Block(WIDTHS[-1]))
        self.after = nn.ModuleList(Block(width) for width in WIDTHS[1:-1])
        self.last = nn.Conv2d(first, first, 3, padding=1)
        self.logit = nn.Conv2d(first, 1, 1)
        self.trust = nn.Parameter(torch.tensor(0.5))
        self.nothing = nn.Sequential(nn.Conv2d(2 * first, first, 1), nn.ReLU(), nn.Conv2d(first, 1, 1))
        nn.init.zeros_(self.logit.weight)

    def forward(
        self, evidence: Tensor, brightness: Tensor, coverage: Tensor, surface: Tensor, light: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        Z, h, w = surface.shape
        mean_evidence = f.avg_pool2d(evidence[:, None], 2)
        cell_brightness = f.avg_pool2d(brightness[:, None] ** 2, 2).clamp(min=1e-6).sqrt()
        level = (light / 3).view(1, 1, 1, 1).expand(Z, 1, h, w)
        parts = [mean_evidence, cell_brightness, coverage[:, None], surface[:, None] / 4, level]
        fine = x = f.relu(self.stem(torch.cat(parts, dim=1)))
        kept = []
        for down, blocks in zip(self.down, self.before, strict=False):
            x = blocks(down(x))
            kept.append(x)
        x = self.coarsest(self.down[-1](x))
        for place in reversed(range(len(kept))):
            wider = f.interpolate(self.up[place + 1](x), scale_factor=2.0, mode="nearest")
            x = self.after[place](kept[place] + wider)
        x = f.relu(fine + f.interpolate(self.up[0](x), scale_factor=2.0, mode="nearest"))
        x = x + f.relu(self.last(x))
        logit = self.logit(x) + self.trust * surface[:, None]
        nothing = self.nothing(torch.cat([x.amax(0, keepdim=True), x.mean(0, keepdim=True)], dim=1))
        return x, logit, nothing


class Head(nn.Module):
    """Logits (Z, h, w) of blocks of 2 px."""

    def __init__(self) -> None:
        super().__init__()
        self.spread = nn.Conv2d(WIDTHS[0], 4 * HEAD, 1)
        self.mix = nn.Conv2d(HEAD + 4, HEAD, 3, padding=1)
        self.logit = nn.Conv2d(HEAD, 1, 1)
        nn.init.zeros_(self.logit.weight)

    def forward(self, features: Tensor, cell_logit: Tensor, evidence: Tensor, brightness: Tensor) -> Tensor:
        own = evidence[:, None]
        parts = [
            f.pixel_shuffle(self.spread(features), 2),
            own,
            moved(own, 1),
            moved(own, -1),
            brightness[:, None],
        ]
        x = f.relu(self.mix(torch.cat(parts, dim=1)))
        return (self.logit(x) + f.interpolate(cell_logit, scale_factor=2.0, mode="nearest"))[:, 0]


class DepthNetwork(nn.Module):
    """Log-probabilities (Z + 1, h, w) of the planes and, last, of no surface, for blocks of 2 px."""

    def __init__(self) -> None:
        super().__init__()
        self.trunk, self.head = Trunk(), Head()

    def forward(
        self, evidence: Tensor, brightness: Tensor, coverage: Tensor, surface: Tensor, light: Tensor
    ) -> Tensor:
        features, cell_logit, nothing = self.trunk(evidence, brightness, coverage, surface, light)
        logit = self.head(features, cell_logit, evidence, brightness)
        nothing = f.interpolate(nothing, scale_factor=2.0, mode="nearest")[:, 0]
        return f.log_softmax(torch.cat([logit, nothing]), dim=0)

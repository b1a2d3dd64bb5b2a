"""The network of depth and masks in PyTorch.

All planes of B films are treated alike: they are the batch (B Z, C, h, w) of two-dimensional convolutions,
between which those of a film exchange features with the planes 1 and 4 steps away and with the largest and
the mean over all planes. A U-net from cells of 4 px up to cells of 64 px sees shapes; a head of blocks of 2
px sees outlines. A hint says how near each plane is to one whose mask is asked for. From the same features
each plane has two logits: that its depth is the surface's, and that the surface belongs to an object in focus
there.
"""

from itertools import pairwise

import torch  # pyright: ignore[reportMissingImports]
import torch.nn.functional as f  # pyright: ignore[reportMissingImports]
from torch import Tensor, nn  # pyright: ignore[reportMissingImports]

WIDTHS = (16, 32, 56, 80, 80)
"""Channels of cells of 4, 8, 16, 32 and 64 px."""
HEAD = 8
"""Channels of blocks."""
STEPS = (1, -1, 4, -4)
MOVED = 8
"""One channel in `MOVED` is exchanged by each of the steps."""


def moved(x: Tensor, planes: int) -> Tensor:
    """The features (B, Z, ...) of the plane that is `planes` before each, 0 where there is none."""
    padded = f.pad(x, (0,) * 6 + (max(planes, 0), max(-planes, 0)))
    return padded[:, : x.shape[1]] if planes > 0 else padded[:, -planes:]


def by_film(x: Tensor, films: int) -> Tensor:
    """Features (B Z, ...) of all planes of B films as (B, Z, ...)."""
    return x.reshape(films, -1, *x.shape[1:])


def over_all(x: Tensor, films: int) -> Tensor:
    """The largest and the mean feature (B, 2 C, h, w) over planes of features (B Z, C, h, w)."""
    if films == 1:  # ONNX Runtime takes the first axis fastest, and in threads
        return torch.cat([x.amax(0, keepdim=True), x.mean(0, keepdim=True)], dim=1)
    planes = by_film(x, films)
    return torch.cat([planes.amax(1), planes.mean(1)], dim=1)


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

    def forward(self, x: Tensor, films: int) -> Tensor:
        n, planes = self.share, by_film(x, films)
        parts = [moved(planes[:, :, i * n : (i + 1) * n], step) for i, step in enumerate(STEPS)]
        exchanged = torch.cat([*parts, planes[:, :, len(STEPS) * n :]], dim=2).flatten(0, 1)
        first = by_film(self.first(exchanged), films) + self.over_planes(over_all(x, films))[:, None]
        return x + self.second(f.relu(first).flatten(0, 1))


class Blocks(nn.ModuleList):
    """Blocks one after another."""

    def __init__(self, count: int, width: int) -> None:
        super().__init__(Block(width) for _ in range(count))

    def forward(self, x: Tensor, films: int) -> Tensor:
        for block in self:
            x = block(x, films)
        return x


class Trunk(nn.Module):
    """Features (B Z, 16, h, w) of cells of 4 px, their logits, and that of no surface (B, 1, h, w).

    Logits (B Z, 1, h, w) are those of depth and of masks.
    """

    def __init__(self) -> None:
        super().__init__()
        first = WIDTHS[0]
        self.stem = nn.Conv2d(5, first, 3, padding=1)
        self.hint = nn.Linear(2, first, bias=False)
        self.down = nn.ModuleList(nn.Conv2d(fine, coarse, 2, stride=2) for fine, coarse in pairwise(WIDTHS))
        self.up = nn.ModuleList(nn.Conv2d(coarse, fine, 1) for fine, coarse in pairwise(WIDTHS))
        self.before = nn.ModuleList(Blocks(2, width) for width in WIDTHS[1:-1])
        self.coarsest = Blocks(2, WIDTHS[-1])
        self.after = nn.ModuleList(Blocks(1, width) for width in WIDTHS[1:-1])
        self.last = nn.Conv2d(first, first, 3, padding=1)
        self.logit = nn.Conv2d(first, 1, 1)
        self.mask = nn.Conv2d(first, 1, 1)
        self.trust = nn.Parameter(torch.tensor(0.5))
        self.nothing = nn.Sequential(nn.Conv2d(2 * first, first, 1), nn.ReLU(), nn.Conv2d(first, 1, 1))
        for start_at_zero in (self.hint, self.logit, self.mask):
            nn.init.zeros_(start_at_zero.weight)

    def forward(self, *inputs: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        evidence, brightness, coverage, surface, light, hint = inputs  # those of `NetworkInputs`
        films = surface.shape[0]
        cell_brightness = f.avg_pool2d(brightness**2, 2).clamp(min=1e-6).sqrt()
        level = (light / 3).view(-1, 1, 1, 1).expand_as(surface)
        parts = [f.avg_pool2d(evidence, 2), cell_brightness, coverage, surface / 4, level]
        of_planes = self.hint(hint).flatten(0, 1)[:, :, None, None]
        fine = x = f.relu(self.stem(torch.stack(parts, dim=2).flatten(0, 1)) + of_planes)
        finer = []
        for down, blocks in zip(self.down, self.before, strict=False):
            x = blocks(down(x), films)
            finer.append(x)
        x = self.coarsest(self.down[-1](x), films)
        for place in reversed(range(len(finer))):
            wider = f.interpolate(self.up[place + 1](x), scale_factor=2.0, mode="nearest")
            x = self.after[place](finer[place] + wider, films)
        x = f.relu(fine + f.interpolate(self.up[0](x), scale_factor=2.0, mode="nearest"))
        x = x + f.relu(self.last(x))
        logit = self.logit(x) + self.trust * surface.flatten(0, 1)[:, None]
        return x, logit, self.mask(x), self.nothing(over_all(x, films))


class Head(nn.Module):
    """Logits (B, Z, h, w) of blocks of 2 px: of depth, and of masks."""

    def __init__(self) -> None:
        super().__init__()
        self.spread = nn.Conv2d(WIDTHS[0], 4 * HEAD, 1)
        self.mix = nn.Conv2d(HEAD + 4, HEAD, 3, padding=1)
        self.logit = nn.Conv2d(HEAD, 1, 1)
        self.mask = nn.Conv2d(HEAD, 1, 1)
        nn.init.zeros_(self.logit.weight)
        nn.init.zeros_(self.mask.weight)

    def forward(self, *inputs: Tensor) -> tuple[Tensor, Tensor]:
        features, cell_logit, cell_mask, evidence, brightness = inputs
        blocks = evidence[:, :, None]
        of_blocks = torch.cat([blocks, moved(blocks, 1), moved(blocks, -1), brightness[:, :, None]], dim=2)
        x = torch.cat([f.pixel_shuffle(self.spread(features), 2), of_blocks.flatten(0, 1)], dim=1)
        x = f.relu(self.mix(x))
        logits = self.logit(x) + f.interpolate(cell_logit, scale_factor=2.0, mode="nearest")
        masks = self.mask(x) + f.interpolate(cell_mask, scale_factor=2.0, mode="nearest")
        films = evidence.shape[0]
        return by_film(logits, films)[:, :, 0], by_film(masks, films)[:, :, 0]


class SurfaceNetwork(nn.Module):
    """Log-probabilities (B, Z + 1, h, w) of the planes and, last, of no surface; logits of masks (B, Z, h,
    w).

    Both are of blocks of 2 px. A mask's logit is relative to that of belonging to none of the planes, which
    is 0.
    """

    def __init__(self) -> None:
        super().__init__()
        self.trunk, self.head = Trunk(), Head()

    def forward(self, evidence: Tensor, brightness: Tensor, *others: Tensor) -> tuple[Tensor, Tensor]:
        *cells, nothing = self.trunk(evidence, brightness, *others)
        logit, mask = self.head(*cells, evidence, brightness)
        nothing = f.interpolate(nothing, scale_factor=2.0, mode="nearest")
        return f.log_softmax(torch.cat([logit, nothing], dim=1), dim=1), mask

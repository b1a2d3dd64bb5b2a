"""Whether the datasets of a benchmark are those that were published: the same bytes, or the same light.

On the same kind of machine the same bytes come out. Others (of another vector width, say) round otherwise,
so that some light paths end elsewhere and the photons are other draws of the same light. Then photons are
compared in tiles of the film: with a and b photons in a tile the sum of (a - b)^2 / (a + b) has a chi-square
distribution, with as many degrees of freedom as there are tiles with photons.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pcii.io.dataset import Dataset
from pcii.store.hashes import hash_json

TILE_PX = 64
LEAST_P = 1e-4
"""Benchmarks that are draws of the same light are taken for others this rarely, over all their datasets."""
LIGHT_TOLERANCE = 0.01
"""Of the light of a view, whose rendering noise is a tenth of it."""

Content = Mapping[str, Any]
"""Of a dataset: a hash of its files, and what its photons or its radiance are in brief."""


def content_of(dataset: Dataset) -> Content:
    """What a dataset is compared by."""
    files = {name: entry["sha256"] for name, entry in dataset.manifest["files"].items()}
    found: dict[str, Any] = {"sha256": hash_json(files)}
    if dataset.has_counts:
        grid, events = dataset.grid, dataset.counts.events
        across = -(-grid.width // TILE_PX)
        views = events.k.astype(np.int64) * grid.cols + events.l
        tiles = events.i.astype(np.int64) // TILE_PX * across + events.j // TILE_PX
        for name, place, size in (
            ("views", views, grid.view_count),
            ("tiles", tiles, -(-grid.height // TILE_PX) * across),
        ):
            found[name] = np.bincount(place, events.n, size).astype(np.int64).tolist()
    if dataset.views is not None:
        cameras = np.ndindex(dataset.grid.rows, dataset.grid.cols)
        found["light"] = [float(f"{dataset.views.view(k, l).mean(dtype=np.float64):.6g}") for k, l in cameras]
    return found


@dataclass(frozen=True)
class Verdict:
    """How the datasets compare with the published ones; `problems` is a sentence for each that differs."""

    compared: int
    same_bytes: int
    least_p: float
    """Of the chi-square tests of photons in other bytes, times the number of tests; at most 1."""
    problems: tuple[str, ...]

    def sentence(self) -> str:
        """The verdict in words."""
        if self.problems:
            return f"{len(self.problems)} of {self.compared} datasets are not those that were published"
        if self.same_bytes == self.compared:
            return f"all {self.compared} datasets have the bytes that were published"
        return (
            f"{self.same_bytes} of {self.compared} datasets have the bytes that were published; the others, "
            f"of another kind of machine, are draws of the same light (p = {self.least_p:.2g})"
        )


def compare(own: Mapping[str, Content], published: Mapping[str, Content]) -> Verdict:
    """Compare datasets by name with the published ones; those that are not there are not compared."""
    problems = [f"{name}: is not in the published benchmark" for name in own if name not in published]
    others = {
        name: (content, published[name])
        for name, content in own.items()
        if name in published and content["sha256"] != published[name]["sha256"]
    }
    tests = {
        name: _photons_p(ours, theirs)
        for name, (ours, theirs) in others.items()
        if {"tiles"} <= {*ours, *theirs}
    }
    for name, p in tests.items():
        if p * len(tests) < LEAST_P:
            problems.append(f"{name}: its photons lie elsewhere than the published ones (p = {p:.2g})")
    for name, (ours, theirs) in others.items():
        if name in tests:
            continue
        lights = [np.array(content.get("light", [])) for content in (ours, theirs)]
        if lights[0].shape != lights[1].shape or not np.allclose(*lights, rtol=LIGHT_TOLERANCE):
            problems.append(f"{name}: its views have other light than the published ones")
    least_p = min([1.0, *(p * len(tests) for p in tests.values())])
    same_bytes = len(own.keys() & published.keys()) - len(others)
    return Verdict(len(own), same_bytes, least_p, tuple(problems))


def _photons_p(ours: Content, theirs: Content) -> float:
    """Probability that draws of the same light differ by more, in tiles or in the totals of views."""
    from scipy.stats import chi2

    smallest = 1.0
    for name in ("tiles", "views"):
        a, b = (np.array(content[name], np.float64) for content in (ours, theirs))
        if a.shape != b.shape:
            return 0.0
        total = a + b
        distance = float(np.divide((a - b) ** 2, total, out=np.zeros_like(total), where=total > 0).sum())
        smallest = min(smallest, 2 * float(chi2.sf(distance, np.count_nonzero(total))))
    return smallest

"""What is true of every section: ten thousand random cases each in the slow tests, some hundred else."""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from twins import unit_grid

from pcii.sections.reconstruction import reconstruct
from pcii.types.bayer import PATTERNS
from pcii.types.camera_grid import CameraGrid
from pcii.types.photon_counts import PhotonCounts
from pcii.types.section_stack import Sections

pytestmark = pytest.mark.parametrize("number", [400, pytest.param(10_000, marks=pytest.mark.slow)])


@dataclass(frozen=True)
class Case:
    """Counts of some grid behind some pattern, and how to reconstruct them."""

    grid: CameraGrid
    cfa: str | None
    z_mm: float
    subpixel: int
    counts: np.ndarray
    rng: np.random.Generator

    def section(self, counts: np.ndarray, cfa: str | None = None) -> Sections:
        data = PhotonCounts.from_dense(counts, self.grid, cfa=cfa or self.cfa)
        if self.rng.random() < 0.5:  # bright counts are added as images, these never
            e = data.events
            data = PhotonCounts.from_events(e.k, e.l, e.i, e.j, e.n, self.grid, cfa=cfa or self.cfa)
        return reconstruct(data, self.z_mm, subpixel=self.subpixel)


def cases(number: int, margin: int = 0) -> Iterator[Case]:
    """Random cases; photons keep `margin` pixels away from the borders. A warning is an error."""
    rng = np.random.default_rng(number)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(number):
            rows, cols = rng.integers(1, 5, 2).tolist()
            height, width = (2 * margin + rng.integers(1, 8, 2)).tolist()
            # Pitches at random: no camera's shift is half a pixel, where a mirror would round the other way.
            pitch, shear = rng.uniform(0.1, 3, 2), rng.uniform(-2, 2, 2) * rng.integers(0, 2)
            grid = unit_grid(rows, cols, height, width, tuple(pitch), tuple(shear))
            counts = np.zeros(grid.shape_KLHW, dtype=np.int64)
            inner = (..., slice(margin, height - margin), slice(margin, width - margin))
            counts[inner] = rng.poisson(rng.choice([0.05, 1, 40]), counts[inner].shape)
            cfa = rng.choice([*PATTERNS, ""]).item() or None
            yield Case(grid, cfa, float(rng.uniform(0.8, 4)), int(rng.integers(1, 4)), counts, rng)


def mirrored(cfa: str | None, size: int, axis: int) -> str | None:
    """The pattern of a mosaic of so many rows (or columns) when it is turned round."""
    if cfa is None or size % 2:
        return cfa
    return cfa[2:] + cfa[:2] if axis == 0 else cfa[1] + cfa[0] + cfa[3] + cfa[2]


def test_a_mirrored_scene_gives_a_mirrored_section(number: int) -> None:
    for case in cases(number):
        axis = int(case.rng.integers(0, 2))
        cameras, size = case.counts.shape[axis], case.counts.shape[axis + 2]
        if case.subpixel % 2 == 0 and cameras % 2:
            continue  # the middle camera's samples lie between two fine voxels, and go to the right one
        plain = case.section(case.counts)
        other = case.section(np.flip(case.counts, (axis, axis + 2)), mirrored(case.cfa, size, axis))
        np.testing.assert_array_equal(np.flip(other.counts, axis + 1), plain.counts)
        np.testing.assert_array_equal(np.flip(other.coverage, axis + 1), plain.coverage)


def test_a_moved_scene_gives_a_moved_section(number: int) -> None:
    margin = 14  # shifts of up to 1.5 x (3 / 0.8 + 2) px, and 4 px of the move
    for case in cases(number, margin):
        move = 2 * case.rng.integers(-2, 3, 2)  # even: a Bayer pattern stays what it is
        plain = case.section(case.counts).counts[0]
        moved = case.section(np.roll(case.counts, move, axis=(2, 3))).counts[0]
        assert plain.sum() == case.counts.sum()
        np.testing.assert_array_equal(np.roll(plain, move * case.subpixel, axis=(0, 1)), moved)

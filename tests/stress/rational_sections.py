"""Sections by whole numbers and fractions, without any rounding: what floating point is compared with."""

from fractions import Fraction

import numpy as np
import twins

from pcii.types import CameraGrid

Voxel = tuple[int, int, int]


def samples_of(
    values: np.ndarray, grid: CameraGrid, z_mm: float, *, cfa: str | None = None, subpixel: int = 1
) -> dict[Voxel, list[Fraction]]:
    """The samples of `twins.samples_of` as fractions."""
    meeting = twins.samples_of(values, grid, z_mm, cfa=cfa, subpixel=subpixel)
    return {voxel: [*map(Fraction, samples)] for voxel, samples in meeting.items()}


def variance_of(samples: list[Fraction]) -> Fraction:
    """Unbiased variance; 0 below two samples."""
    if len(samples) < 2:
        return Fraction(0)
    mean = sum(samples, Fraction(0)) / len(samples)
    return sum(((sample - mean) ** 2 for sample in samples), Fraction(0)) / (len(samples) - 1)

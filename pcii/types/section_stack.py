"""Sections: the scene reconstructed at several depths, with the number of samples of each voxel."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from pcii.base import InputError, listed, times
from pcii.types.arrays import Plottable, read_only
from pcii.types.bayer import by_colour, check_cfa
from pcii.types.camera_grid import CameraGrid
from pcii.types.focal_planes import FocalPlanes
from pcii.types.readout import PLAIN, Readout

Shifts = Literal["nearest", "even"]


@dataclass(frozen=True, eq=False, repr=False)
class Sections(Plottable):
    """Sections of the scene at `planes`, in the frame of the virtual centre camera.

    `counts` (Z, H, W, C) is the sum of the samples that meet at each voxel: integers for photons, real
    numbers for radiance. `samples` is their `coverage`, or a function that makes it when it is first asked
    for: on one plane that takes as long as adding 100 000 photons. With `subpixel` = M the voxel grid is M
    times finer in both axes. `variance` (Z, H, W, C) is that of the samples of each voxel, or None. `cfa` is
    the Bayer pattern of sections that are mosaics themselves (of even shifts), `readout` that of the counts.
    Raises `InputError` if the shapes differ. `pcii.reconstruct` makes them.
    """

    planes: FocalPlanes
    counts: np.ndarray
    samples: np.ndarray | Callable[[], np.ndarray]
    subpixel: int = 1
    variance: np.ndarray | None = None
    cfa: str | None = None
    readout: Readout = PLAIN

    def __post_init__(self) -> None:
        Z, H, W = len(self.planes), self.grid.height * self.subpixel, self.grid.width * self.subpixel
        if self.counts.shape[:3] != (Z, H, W) or self.counts.ndim != 4:
            raise InputError(f"counts: expected ({Z}, {H}, {W}, C), got {self.counts.shape}")
        object.__setattr__(self, "counts", read_only(self.counts))
        if isinstance(self.samples, np.ndarray):
            self.coverage  # noqa: B018 an array of another shape is reported here
        check_cfa(self.cfa)
        if self.variance is not None:
            if self.variance.shape != self.counts.shape:
                raise InputError("variance: must have the shape of counts")
            object.__setattr__(self, "variance", read_only(self.variance))

    def _facts(self) -> dict[str, object]:
        photons = None
        if self.counts.dtype.kind in "iu":  # every plane is made of the same photons
            photons = listed([int(plane.sum(dtype=np.int64)) for plane in self.counts])
        return {
            "z_mm": listed(self.z_mm.tolist()),
            "shape": times(self.counts.shape),
            "photons": photons,
            "subpixel": self.subpixel,
            "cfa": self.cfa,
        }

    @property
    def grid(self) -> CameraGrid:
        """The cameras."""
        return self.planes.grid

    @property
    def z_mm(self) -> np.ndarray:
        """Depths of the planes (Z,) float64."""
        return self.planes.z_mm

    @cached_property
    def coverage(self) -> np.ndarray:
        """Number of the samples that meet at each voxel, (Z, H, W, C)."""
        coverage = self.samples if isinstance(self.samples, np.ndarray) else self.samples()
        if coverage.shape != self.counts.shape:
            raise InputError("coverage: must have the shape of counts")
        return read_only(coverage)

    @cached_property
    def estimate(self) -> np.ndarray:
        """Photons (or radiance) per sample, (Z, H, W, C) float64: Eqs. 2 and 3 of Muniraj et al. 2017.

        For photon counts it is the maximum-likelihood estimate of the photons per pixel and view;
        Eq. 3 divides it further by the photon budget n, and the sum by R S, the number of cameras, which
        darkens borders; here it is divided by the coverage. A voxel that no sample reaches is 0. What frames
        of few bits miss is made up for: see `Readout.photons`.
        """
        return read_only(self.readout.photons(self.counts, self.coverage))

    def in_colours(self, plane: int) -> tuple[np.ndarray, np.ndarray]:
        """Sums and numbers of samples of one plane, (H, W, C) each; those of mosaics in three colours."""
        sums, samples = self.counts[plane], self.coverage[plane]
        if self.cfa is None:
            return sums, samples
        return by_colour(sums[..., 0], self.cfa), by_colour(samples[..., 0], self.cfa)

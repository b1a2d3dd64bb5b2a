"""Sections: the scene reconstructed at several depths, with the number of samples of each voxel."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from pcii.base.errors import InputError
from pcii.base.short_form import Brief, listed, times
from pcii.core.array_labels import SECTIONS_LABELS
from pcii.core.arrays import read_only
from pcii.core.bayer import check_cfa
from pcii.core.camera_grid import CameraGrid
from pcii.core.focal_planes import FocalPlanes
from pcii.core.xarray_form import labelled_dataset

if TYPE_CHECKING:
    import xarray

Normalisation = Literal["overlap", "views"]
Shifts = Literal["nearest", "bilinear", "even"]


@dataclass(frozen=True, eq=False, repr=False)
class Sections(Brief):
    """Sections of the scene at `planes`, in the frame of the virtual centre camera.

    `counts` (Z, H, W, C) is the sum of the samples that meet at each voxel: integers for photons,
    real numbers for radiance. `coverage` (Z, H, W, C) is the number of these samples. With `subpixel` = M
    the voxel grid is M times finer in both axes. `variance` (Z, H, W, C) is that of the samples of each
    voxel, or None. `cfa` is the Bayer pattern of sections that are mosaics themselves (of even shifts).
    Raises `InputError` if the shapes differ. `pcii.reconstruct` makes them.
    """

    planes: FocalPlanes
    counts: np.ndarray
    coverage: np.ndarray
    subpixel: int = 1
    normalisation: Normalisation = "overlap"
    variance: np.ndarray | None = None
    cfa: str | None = None

    def __post_init__(self) -> None:
        Z, H, W = len(self.planes), self.grid.height * self.subpixel, self.grid.width * self.subpixel
        if self.counts.shape[:3] != (Z, H, W) or self.counts.ndim != 4:
            raise InputError(f"counts: expected ({Z}, {H}, {W}, C), got {self.counts.shape}")
        if self.coverage.shape != self.counts.shape:
            raise InputError("coverage: must have the shape of counts")
        object.__setattr__(self, "counts", read_only(self.counts))
        object.__setattr__(self, "coverage", read_only(self.coverage))
        check_cfa(self.cfa)
        if self.variance is not None:
            if self.variance.shape != self.counts.shape:
                raise InputError("variance: must have the shape of counts")
            object.__setattr__(self, "variance", read_only(self.variance))

    def _facts(self) -> dict[str, object]:
        counted = self.counts.dtype.kind in "iu"
        return {
            "z_mm": listed(self.z_mm.tolist()),
            "shape": times(self.counts.shape),
            "photons": int(self.counts.sum(dtype=np.int64)) if counted else None,
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
    def estimate(self) -> np.ndarray:
        """Mean per sample, (Z, H, W, C) float64: Eqs. 2 and 3 of Muniraj et al. 2017.

        For photon counts it is the maximum-likelihood estimate of the photons per pixel and view;
        Eq. 3 divides it further by the photon budget n. Under `normalisation` "overlap" the sum is
        divided by the coverage, under "views" by R S, the number of cameras. A voxel that no
        sample reaches is 0.
        """
        if self.normalisation == "views":
            return read_only(self.counts / self.grid.view_count)
        mean = np.zeros(self.counts.shape, dtype=np.float64)
        np.divide(self.counts, self.coverage, out=mean, where=self.coverage > 0)
        return read_only(mean)

    def to_xarray(self) -> "xarray.Dataset":
        """`counts`, `coverage`, `estimate` and, if known, `variance` over planes, voxels and channels."""
        arrays = {"counts": self.counts, "coverage": self.coverage, "estimate": self.estimate}
        if self.variance is not None:
            arrays["variance"] = self.variance
        labels = SECTIONS_LABELS
        if self.counts.dtype.kind not in "iu":  # of radiance, whose unit is not known here
            labels = {name: replace(label, unit="1") for name, label in labels.items()}
        return labelled_dataset(
            arrays, labels, grid=self.grid, cfa=self.cfa, planes_mm=self.z_mm, subpixel=self.subpixel
        )

"""Elemental images and the sections made of them."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np

from pcii.core.arrays import check_z_mm, read_only
from pcii.core.bayer import check_cfa
from pcii.core.camera_grid import CameraGrid
from pcii.core.errors import InputError
from pcii.core.short_form import Brief, listed, times

Normalisation = Literal["overlap", "views"]
Shifts = Literal["nearest", "bilinear", "even"]


class ArrayLike5D(Protocol):
    """What `Views` needs of its pixels: a shape and one view at a time, so that they may stay on disk."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    def __getitem__(self, index: Any, /) -> Any: ...


@dataclass(frozen=True, eq=False, repr=False)
class Views(Brief):
    """Linear radiance of every elemental image, (K, L, H, W, C), C = 1 or 3.

    `cfa` names the Bayer pattern when C = 1 and the images are mosaics; None means that every pixel
    holds all C channels. `radiance` may be any object with `shape` and `[k, l]` (an array, or a
    reader that loads one view at a time).
    """

    radiance: ArrayLike5D
    grid: CameraGrid
    cfa: str | None = None

    def __post_init__(self) -> None:
        check_cfa(self.cfa)
        shape = tuple(self.radiance.shape)
        if len(shape) != 5 or shape[:4] != self.grid.shape_KLHW or shape[4] not in (1, 3):
            raise InputError(f"radiance: expected shape {(*self.grid.shape_KLHW, '1 or 3')}, got {shape}")
        if self.cfa is not None and shape[4] != 1:
            raise InputError("radiance: a Bayer mosaic has one channel per pixel, C = 1")
        if isinstance(self.radiance, np.ndarray):
            if self.radiance.dtype.kind not in "fiu":
                raise InputError(f"radiance: expected real numbers, got {self.radiance.dtype}")
            object.__setattr__(self, "radiance", read_only(self.radiance))

    def _facts(self) -> dict[str, object]:
        return {"shape": times(self.radiance.shape), "cfa": self.cfa}

    @property
    def channel_count(self) -> int:
        """Colours that sections of these views will have."""
        return 3 if self.cfa is not None else self.radiance.shape[4]

    def view(self, k: int, l: int) -> np.ndarray:
        """Image (H, W, C) of camera (k, l); raises `InputError` if it holds NaN or infinity."""
        image = np.asarray(self.radiance[k, l])
        if not np.all(np.isfinite(image)):
            raise InputError(f"radiance: view ({k}, {l}) holds NaN or infinity")
        return image


@dataclass(frozen=True, eq=False, repr=False)
class Sections(Brief):
    """Sections of the scene at depths `z_mm`, in the frame of the virtual centre camera.

    `counts` (Z, H, W, C) is the sum of the samples that meet at each voxel: integers for photons,
    real numbers for radiance. `coverage` (Z, H, W, C) is how many samples that was. With `subpixel` = M
    the voxel grid is M times finer in both axes. `variance` is that of the samples of each voxel, if it
    was asked for. `cfa` is the Bayer pattern of sections that are mosaics themselves (of even shifts).
    """

    grid: CameraGrid
    z_mm: np.ndarray
    counts: np.ndarray
    coverage: np.ndarray
    subpixel: int = 1
    normalisation: Normalisation = "overlap"
    variance: np.ndarray | None = None
    cfa: str | None = None

    def __post_init__(self) -> None:
        z = check_z_mm(self.z_mm)
        H, W = self.grid.height * self.subpixel, self.grid.width * self.subpixel
        if self.counts.shape[:3] != (z.size, H, W) or self.counts.ndim != 4:
            raise InputError(f"counts: expected ({z.size}, {H}, {W}, C), got {self.counts.shape}")
        if self.coverage.shape != self.counts.shape:
            raise InputError("coverage: must have the shape of counts")
        object.__setattr__(self, "z_mm", read_only(z))
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

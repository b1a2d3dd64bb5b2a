"""The nouns of the package: frozen, checked on construction, arrays read-only.

Axes, always in this order: (K, L, H, W, C) for views, (Z, H, W, C) for sections; C is R, G, B.
Lengths are millimetres and carry `_mm`; `z` is planar depth from the camera plane, never ray length.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, Protocol, TypeGuard

import numpy as np

from pcii.bayer import check_cfa
from pcii.brief import Brief, listed, span, table, times
from pcii.errors import InputError

Normalisation = Literal["overlap", "views"]
Shifts = Literal["nearest", "bilinear", "even"]


def read_only(array: np.ndarray) -> np.ndarray:
    """A view of `array` that refuses to be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


def check_z_mm(z_mm: object) -> np.ndarray:
    """Depths as a float64 array (Z,); each must be a finite number above 0, at least one."""
    try:
        z = np.atleast_1d(np.asarray(z_mm, dtype=np.float64))
    except (TypeError, ValueError):
        raise InputError(f"z_mm: expected depths in millimetres, got {z_mm!r}") from None
    if z.ndim != 1 or z.size == 0:
        raise InputError("z_mm: expected one depth or a list of depths in millimetres")
    if not np.all(np.isfinite(z) & (z > 0)):
        bad = z[~(np.isfinite(z) & (z > 0))][0]
        raise InputError(f"z_mm: a depth must be a finite number above 0 mm, got {bad:g}")
    return z


def _check_size(name: str, value: object) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise InputError(f"{name}: expected a whole number of at least 1, got {value!r}")


def _is_finite(value: object) -> TypeGuard[float]:
    number = isinstance(value, int | float | np.integer | np.floating)
    return number and not isinstance(value, bool) and math.isfinite(value)


def _check_length(name: str, value: object) -> None:
    if not (_is_finite(value) and value > 0):
        raise InputError(f"{name}: expected a finite length above 0 mm, got {value!r}")


@dataclass(frozen=True, kw_only=True)
class CameraGrid:
    """A grid of `rows` x `cols` parallel pinhole cameras in the plane Z = 0, looking along +Z.

    Camera (k, l), k from the top, l from the left, stands at X = (l - (cols-1)/2) pitch_x,
    Y = (k - (rows-1)/2) pitch_y. `pitch_mm` is (pitch_x, pitch_y). Each image has `height` x `width`
    square pixels of `pixel_mm`, `focal_mm` behind the pinhole; the optical axis meets pixel
    ((height-1)/2, (width-1)/2). In a sheared grid `shear_px` (x, y) is not 0: each camera's axis meets it
    further right (down) by so many px per camera step, counted from the centre of the grid, so that what
    has that much disparity stands still. Raises `InputError` for a size below 1, a length not above 0 or
    a shear that is not finite.
    """

    rows: int
    cols: int
    pitch_mm: tuple[float, float]
    focal_mm: float
    pixel_mm: float
    height: int
    width: int
    shear_px: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("rows", "cols", "height", "width"):
            _check_size(name, getattr(self, name))
        pitch = self.pitch_mm
        if not isinstance(pitch, tuple | list) or len(pitch) != 2:
            raise InputError(f"pitch_mm: expected two lengths (x, y) in mm, got {pitch!r}")
        for name, value in (("pitch_mm", pitch[0]), ("pitch_mm", pitch[1])):
            _check_length(name, value)
        for name in ("focal_mm", "pixel_mm"):
            _check_length(name, getattr(self, name))
        object.__setattr__(self, "pitch_mm", (float(pitch[0]), float(pitch[1])))
        shear = self.shear_px
        if not isinstance(shear, tuple | list) or len(shear) != 2 or not all(map(_is_finite, shear)):
            raise InputError(f"shear_px: expected two finite numbers (x, y) of pixels, got {shear!r}")
        object.__setattr__(self, "shear_px", (float(shear[0]), float(shear[1])))

    @property
    def view_count(self) -> int:
        """Number of cameras, rows x cols."""
        return self.rows * self.cols

    @property
    def shape_KLHW(self) -> tuple[int, int, int, int]:
        """Shape (K, L, H, W) of one monochrome stack of views."""
        return (self.rows, self.cols, self.height, self.width)


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


@dataclass(frozen=True, eq=False, repr=False)
class Segmented(Brief):
    """Which points of each section are in focus: `in_focus` (Z, H, W) bool.

    `steps` holds the named intermediate maps (Z, H, W) of the method, for looking at. A method that decides
    about single photons says in `photon_in_focus` (Z, N) bool which of the N events of the counts
    (`PhotonCounts.events`, in their order) come from what is in focus in each plane; else that is None.
    """

    z_mm: np.ndarray
    in_focus: np.ndarray
    method: str
    sections: Sections
    steps: Mapping[str, np.ndarray] = field(default_factory=dict)
    photon_in_focus: np.ndarray | None = None

    def __post_init__(self) -> None:
        expected = self.sections.counts.shape[:3]
        if self.in_focus.dtype != np.bool_ or self.in_focus.shape != expected:
            raise InputError(
                f"in_focus: expected bool {expected}, got {self.in_focus.dtype} {self.in_focus.shape}"
            )
        kept = self.photon_in_focus
        if kept is not None:
            if kept.dtype != np.bool_ or kept.ndim != 2 or kept.shape[0] != expected[0]:
                raise InputError(
                    f"photon_in_focus: expected bool ({expected[0]}, events), got {kept.dtype} {kept.shape}"
                )
            object.__setattr__(self, "photon_in_focus", read_only(kept))
        object.__setattr__(self, "z_mm", read_only(check_z_mm(self.z_mm)))
        object.__setattr__(self, "in_focus", read_only(self.in_focus))

    def _facts(self) -> dict[str, object]:
        shares = [f"{share:.2%}" for share in self.in_focus.mean(axis=(1, 2))]
        return {
            "method": self.method,
            "z_mm": listed(self.z_mm.tolist()),
            "shape": times(self.in_focus.shape),
            "in_focus": listed(shares),
        }

    @property
    def cleaned(self) -> np.ndarray:
        """Section estimates with what is defocused set to zero, (Z, H, W, C)."""
        return self.sections.estimate * self.in_focus[..., None]


@dataclass(frozen=True, eq=False, repr=False)
class DepthMap(Brief):
    """Depth per pixel of the virtual centre: `z_mm` (H, W), NaN where the method abstains.

    `confidence` (H, W) is in [0, 1]: 0 where it abstains.
    """

    z_mm: np.ndarray
    confidence: np.ndarray

    def __post_init__(self) -> None:
        if self.z_mm.ndim != 2 or self.confidence.shape != self.z_mm.shape:
            raise InputError("z_mm, confidence: expected two maps (H, W) of the same shape")
        object.__setattr__(self, "z_mm", read_only(self.z_mm))
        object.__setattr__(self, "confidence", read_only(self.confidence))

    def _facts(self) -> dict[str, object]:
        answered = self.z_mm[np.isfinite(self.z_mm)]
        share = f"{answered.size / max(1, self.z_mm.size):.2%}"
        return {"shape": times(self.z_mm.shape), "answered": share, "z_mm": span(answered)}


@dataclass(frozen=True, repr=False)
class PhotonTruth(Brief):
    """Where each detected photon came from: five arrays and a depth, (N,).

    Camera (k, l), pixel (i, j), and the `object_id` and planar `z_mm` of what its path hit first.
    """

    k: np.ndarray
    l: np.ndarray
    i: np.ndarray
    j: np.ndarray
    object_id: np.ndarray
    z_mm: np.ndarray

    def _facts(self) -> dict[str, object]:
        return {"photons": self.z_mm.size, "objects": np.unique(self.object_id).size}


@dataclass(frozen=True, eq=False, repr=False)
class Truth(Brief):
    """What the virtual centre camera really sees, from first hits at pixel centres.

    `z_mm` (H, W) is planar depth, +inf where nothing was hit; `object_id` (H, W) is 0 for the
    backdrop and for nothing, else a key of `names`. `photons` is known for simulated photons only.

    More is there if the dataset has it. `normal` (H, W, 3) float32: unit normal of the surface in world axes,
    on the side that the camera sees; 0 where nothing is hit. `coverage` (H, W) float32: the share of the
    pixel's square that belongs to the object (or to none) that its centre hits. `visible_views` (H, W)
    uint16: how many cameras of the grid see the point; 0 where nothing is hit.
    """

    z_mm: np.ndarray
    object_id: np.ndarray
    names: Mapping[int, str]
    photons: PhotonTruth | None = None
    normal: np.ndarray | None = None
    coverage: np.ndarray | None = None
    visible_views: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.z_mm.ndim != 2 or self.object_id.shape != self.z_mm.shape:
            raise InputError("z_mm, object_id: expected two maps (H, W) of the same shape")
        if not (self.z_mm > 0).all():
            raise InputError("z_mm: true depths are above 0 mm and never NaN; a miss is +inf")
        unknown = set(np.unique(self.object_id).tolist()) - {0, *self.names}
        if unknown:
            raise InputError(f"object_id: id {min(unknown)} has no name")
        H, W = self.z_mm.shape
        self._check_map("normal", (H, W, 3), np.float32, -1, 1)
        self._check_map("coverage", (H, W), np.float32, 0, 1)
        self._check_map("visible_views", (H, W), np.uint16, 0, np.inf)
        object.__setattr__(self, "z_mm", read_only(self.z_mm))
        object.__setattr__(self, "object_id", read_only(self.object_id))

    def _facts(self) -> dict[str, object]:
        hit = self.z_mm[np.isfinite(self.z_mm)]
        photons = None if self.photons is None else self.photons.z_mm.size
        objects = listed(list(self.names.values()))
        return {"shape": times(self.z_mm.shape), "z_mm": span(hit), "photons": photons, "objects": objects}

    def _check_map(self, name: str, shape: tuple[int, ...], dtype: type, least: float, most: float) -> None:
        """An optional map, made read-only; lengths of 1 may be rounded by 1e-6."""
        values = getattr(self, name)
        if values is None:
            return
        if values.shape != shape or values.dtype != dtype:
            raise InputError(f"{name}: expected {np.dtype(dtype)} {shape}, got {values.dtype} {values.shape}")
        if not ((values >= least - 1e-6) & (values <= most + 1e-6)).all():
            raise InputError(f"{name}: expected values from {least} to {most}")
        object.__setattr__(self, name, read_only(values))


@dataclass(frozen=True, repr=False)
class Score(Brief):
    """What `score.json` holds: rows per plane, entropies per object, errors of the depth map, bounds."""

    planes: tuple[Mapping[str, Any], ...]
    objects: tuple[Mapping[str, Any], ...]
    depth: Mapping[str, Any]
    dataset: str | None = None
    bounds: Mapping[str, Any] = field(default_factory=dict)

    def _facts(self) -> dict[str, object]:
        return {
            "dataset": self.dataset,
            "methods": listed(list(dict.fromkeys(row["method"] for row in self.planes))),
            "planes": len(self.planes),
            "objects": len(self.objects),
            "depth median_mm": self.depth.get("median_mm"),
        }

    def _repr_html_(self) -> str:
        names = ("z_mm", "method", "truth", "object", "iou", "precision", "recall", "boundary_f")
        rows = [[row.get(name) for name in names] for row in self.planes]
        return table(repr(self), rows, names)

    def to_dict(self) -> dict[str, Any]:
        """The score as plain Python values, in the spelling of `score.json`."""
        return {
            "dataset": self.dataset,
            "planes": [dict(row) for row in self.planes],
            "objects": [dict(row) for row in self.objects],
            "depth": dict(self.depth),
            "bounds": dict(self.bounds),
        }

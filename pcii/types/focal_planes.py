"""Where parallel cameras see a point, the focal planes of sections, and the sections.

A point (X, Y, Z) appears in camera (k, l) at column (W-1)/2 + (l - (L-1)/2) s + (focal / pixel)
(X - X_l) / Z and likewise in rows, so without shear a camera further right sees it further LEFT.
Public functions take depths as numbers or planes and pass planes on: depths are checked and converted to
disparities and shifts once, here. Notation: d disparity in px per camera step; (K, L) cameras; (H, W) pixels
of a view; Z planes; z planar depth; s shear.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from pcii.base import InputError, ShortForm, listed, times
from pcii.types.arrays import Plottable, check_z_mm, freeze_array, read_only
from pcii.types.cameras import PLAIN, CameraGrid, Readout, check_cfa, colours_and_samples
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts, PhotonEvents
from pcii.types.truth import PhotonTruth

Shifts = Literal["nearest", "even"]


def parallax_px(grid: CameraGrid, z_mm: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """(horizontal, vertical) disparity at depth z due to the camera pitch alone, in px per camera step."""
    # Lengths whose product no float64 holds give 0, infinity or NaN; `FocalPlanes` refuses the last two.
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        scale_mm2 = np.asarray(z_mm, dtype=np.float64) * grid.pixel_mm
        return grid.focal_mm * grid.pitch_mm[0] / scale_mm2, grid.focal_mm * grid.pitch_mm[1] / scale_mm2


def disparity_px(grid: CameraGrid, z_mm: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """(horizontal, vertical) disparity at depth z in px per camera step: parallax less shear."""
    across, down = parallax_px(grid, z_mm)
    return across - grid.shear_px[0], down - grid.shear_px[1]


def total_disparity_px(grid: CameraGrid, z_mm: np.ndarray | float) -> np.ndarray:
    """Parallax between the outermost cameras of the longer axis of the grid in px: (N - 1) d, without shear.

    >>> grid = CameraGrid(rows=1, cols=3, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.05, height=4, width=4)
    >>> total_disparity_px(grid, np.array([500.0, 1000.0])).tolist()
    [20.0, 10.0]
    """
    d_x, d_y = parallax_px(grid, z_mm)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.maximum((grid.cols - 1) * d_x, (grid.rows - 1) * d_y)


def parallax_per_total(grid: CameraGrid) -> np.ndarray:
    """(horizontal, vertical) parallax from camera to camera as a share of the total disparity, (2,)."""
    return np.array(parallax_px(grid, 1.0)) / total_disparity_px(grid, 1.0)


def blur_half_extent_px(grid: CameraGrid, z_mm: np.ndarray | float, z0_mm: float) -> np.ndarray:
    """Half-extent in px of the blur of a point at z in the section at z0: total disparity's change / 2."""
    return np.abs(total_disparity_px(grid, z_mm) - total_disparity_px(grid, z0_mm)) / 2


def depth_of_total_disparity_mm(grid: CameraGrid, total_px: np.ndarray) -> np.ndarray:
    """Depths in mm whose total disparity is `total_px`: the inverse of `total_disparity_px`."""
    return float(total_disparity_px(grid, 1.0)) / np.asarray(total_px, dtype=np.float64)


@dataclass(frozen=True, eq=False, repr=False)
class FocalPlanes(ShortForm):
    """Planes in which a camera grid is focused: `z_mm` (Z,) and `total_disparity_px` (Z,), both float64.

    Make it with `at_depths`, `at_total_disparity` or `between`. The total disparity is the parallax over the
    longer axis of the grid, without shear. Raises `InputError` for an empty list, for a depth that is not
    finite or not above 0, and for one so near that views shift by 2^31 pixels.
    """

    grid: CameraGrid
    z_mm: np.ndarray
    total_disparity_px: np.ndarray
    rounding: float = 0.5
    """Whole shifts are floor(x + rounding): the nearest ones of sections, at 1/2."""

    def __post_init__(self) -> None:
        freeze_array(self, "z_mm", "real numbers", ("Z",))
        freeze_array(self, "total_disparity_px", "real numbers", self.z_mm.shape)
        across, down = np.abs(disparity_px(self.grid, self.z_mm))
        with np.errstate(over="ignore"):
            countable = np.maximum(across * self.grid.cols, down * self.grid.rows) < 2**31
        if not countable.all():
            near = self.z_mm[~countable][0]
            raise InputError(f"z_mm: {near:g} mm is so near that views shift by more than 2^31 pixels")

    @classmethod
    def at_depths(cls, grid: CameraGrid, z_mm: object) -> "FocalPlanes":
        """Planes at the planar depths `z_mm`: one number, a list of them, or planes, which are returned.

        Raises `InputError` for an invalid depth, and for planes of another grid.

        >>> grid = CameraGrid(rows=1, cols=3, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.05, height=4, width=4)
        >>> FocalPlanes.at_depths(grid, [500, 1000]).nearest_shifts_px()[1].tolist()
        [[-10, 0, 10], [-5, 0, 5]]
        """
        if isinstance(z_mm, FocalPlanes):
            if z_mm.grid != grid:
                raise InputError("z_mm: these focal planes are of another camera grid")
            return z_mm
        z = check_z_mm(z_mm)
        return cls(grid, z, total_disparity_px(grid, z))

    @classmethod
    def at_total_disparity(cls, grid: CameraGrid, total_disparity_px: object) -> "FocalPlanes":
        """Planes of these total disparities in px, (Z,) or one number, each above 0."""
        total = np.atleast_1d(np.asarray(total_disparity_px, dtype=np.float64))
        return cls(grid, check_z_mm(depth_of_total_disparity_mm(grid, total)), total)

    @classmethod
    def between(cls, grid: CameraGrid, z_near_mm: float, z_far_mm: float, step_px: float) -> "FocalPlanes":
        """Planes from far to near whose total disparities differ by at most `step_px`, in equal steps.

        Depth resolution is uniform in disparity, so planes uniform in depth would waste work far away.
        """
        near, far = total_disparity_px(grid, z_near_mm), total_disparity_px(grid, z_far_mm)
        count = max(2, int(np.ceil((near - far) / step_px)) + 1)
        return cls.at_depths(grid, depth_of_total_disparity_mm(grid, np.linspace(near, far, count)[::-1]))

    def __len__(self) -> int:
        return self.z_mm.size

    def take(self, which: slice | np.ndarray | Sequence[int]) -> "FocalPlanes":
        """The planes chosen by a slice, indices or a mask."""
        return replace(self, z_mm=self.z_mm[which], total_disparity_px=self.total_disparity_px[which])

    def followed_by(self, total_disparity_px: Sequence[float]) -> "FocalPlanes":
        """These planes, followed by planes of the given total disparities in px."""
        if not len(total_disparity_px):
            return self
        others = FocalPlanes.at_total_disparity(self.grid, total_disparity_px)
        total = np.concatenate([self.total_disparity_px, others.total_disparity_px])
        return replace(self, z_mm=np.concatenate([self.z_mm, others.z_mm]), total_disparity_px=total)

    def _facts(self) -> dict[str, object]:
        return {"z_mm": listed(self.z_mm.tolist())}

    @cached_property
    def exact_shifts_px(self) -> tuple[np.ndarray, np.ndarray]:
        """Shifts of the rows (Z, K) and columns (Z, L) of cameras, float64, to the virtual centre.

        A point of the plane that is at row i of camera row k is at row i + (k - (K-1)/2) d of the virtual
        centre, d the disparity; not a whole number in general.
        """
        across, down = disparity_px(self.grid, self.z_mm)
        rows = (np.arange(self.grid.rows) - (self.grid.rows - 1) / 2) * down[:, None]
        cols = (np.arange(self.grid.cols) - (self.grid.cols - 1) / 2) * across[:, None]
        return read_only(rows), read_only(cols)

    def nearest_shifts_px(self, step_px: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """The shifts of rows (Z, K) and columns (Z, L) to multiples of `step_px`, int64.

        They are the nearest for a `rounding` of 1/2: `floor(x + 1/2)` and not `round`, which rounds half to
        even and makes half-pixel shifts alternate.
        """
        rows, cols = (
            np.floor(exact / step_px + self.rounding).astype(np.int64) for exact in self.exact_shifts_px
        )
        return step_px * rows, step_px * cols

    def voxel_indices(self, subpixel: int = 1, step_px: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Voxel rows (Z, K, H) and columns (Z, L, W), int32, to which pixels of each camera belong.

        With `subpixel` = 1 every camera moves by a multiple of `step_px` pixels; with M > 1 the centre of
        pixel i goes to fine row floor((i + 1/2 + (k - (K-1)/2) d) M), 1/2 being the `rounding`. Pixels that
        fall outside the section have an index below 0, or not below its size.
        """
        height, width = self.grid.height, self.grid.width
        axes = zip(self.nearest_shifts_px(step_px), self.exact_shifts_px, (height, width), strict=True)
        indices: list[np.ndarray] = []
        for whole, exact, size in axes:
            index = np.arange(size) + whole[..., None]
            if subpixel > 1:
                index = np.floor((np.arange(size) + self.rounding + exact[..., None]) * subpixel)
            # Far outside the section indices may exceed 32 bits.
            indices.append(np.clip(index, -1, size * subpixel).astype(np.int32))
        return indices[0], indices[1]

    def project(
        self, photons: PhotonEvents | PhotonTruth, plane: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Voxel row and column (N,) int64 of photons in the section at a plane, and whether inside, bool."""
        rows, cols = (index[0] for index in self.take([plane]).voxel_indices())
        row, col = rows[photons.k, photons.i].astype(np.int64), cols[photons.l, photons.j].astype(np.int64)
        height, width = self.grid.shape_HW
        return row, col, (row >= 0) & (row < height) & (col >= 0) & (col < width)


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
        freeze_array(self, "counts", "real numbers", (Z, H, W, "C"))
        if isinstance(self.samples, np.ndarray):
            self.coverage  # noqa: B018 an array of another shape is reported here
        check_cfa(self.cfa)
        if self.variance is not None:
            freeze_array(self, "variance", "real numbers", self.counts.shape)

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
        return colours_and_samples(self.counts[plane], self.cfa, self.coverage[plane])


def check_data(data: object) -> None:
    """Raise `InputError` unless sections can be made of `data`: `PhotonCounts` or `Views`."""
    if not isinstance(data, PhotonCounts | Views):
        expected = "PhotonCounts or Views (of a dataset its .counts or .views)"
        raise InputError(f"data: expected {expected}, got {type(data).__name__}")


def check_depth_counts(counts: object) -> None:
    """Raise `InputError` unless `counts` are `PhotonCounts` of at least two views, which depth needs."""
    if not isinstance(counts, PhotonCounts):
        expected = "PhotonCounts (of a dataset its .counts, of Views pcii.limit_photons)"
        raise InputError(f"counts: expected {expected}, got {type(counts).__name__}")
    if counts.grid.view_count < 2:
        raise InputError("counts: one view has no depth; at least 2 cameras are needed")

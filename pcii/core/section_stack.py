"""Sections: the scene reconstructed at several depths, with the number of samples of each voxel."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from pcii.base.errors import InputError
from pcii.base.short_form import ShortForm, listed, times
from pcii.core.array_labels import SECTIONS_LABELS, labelled_dataset
from pcii.core.arrays import read_only
from pcii.core.bayer import by_colour, check_cfa
from pcii.core.camera_grid import CameraGrid
from pcii.core.focal_planes import FocalPlanes
from pcii.core.photon_events import PLAIN, Readout
from pcii.imaging.blocks import evenly_chosen

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

Shifts = Literal["nearest", "even"]


@dataclass(frozen=True, eq=False, repr=False)
class Sections(ShortForm):
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
        counted = self.counts.dtype.kind in "iu"
        return {
            "z_mm": listed(self.z_mm.tolist()),
            "shape": times(self.counts.shape),
            "photons": int(self.counts.sum(dtype=np.int64)) if counted else None,
            "subpixel": self.subpixel,
            "cfa": self.cfa,
        }

    def _thumbnails(self) -> dict[str, str]:
        return self._thumbnails_of(None)

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

    @property
    def saturated(self) -> np.ndarray:
        """Voxels in which all samples of all frames are full, (Z, H, W, C) bool: the estimate is infinite."""
        return np.isinf(self.estimate)

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

    def plot(self, axes: "Axes | Sequence[Axes] | np.ndarray | None" = None) -> np.ndarray:
        """Draw the sections in their colours, a panel each, and return the Matplotlib axes (N,).

        All have the same exposure, as in a report: the 98th percentile of what is lit is white, each mean
        counting as often as it has samples. Of more than 12 sections 12 are drawn, from the first to the
        last. `axes` has those of each panel, by default of a new figure. Raises `InputError` for another
        number of them.
        """
        return self._draw(axes, None)[0]

    def _draw(
        self, axes: "Axes | Sequence[Axes] | np.ndarray | None", kept: np.ndarray | None
    ) -> tuple[np.ndarray, list[int]]:
        """Draw as `plot` does, only points that are `kept`, bool (Z, H, W); the axes and the planes shown."""
        from pcii.figures.exposure import PANEL_PX, block_px
        from pcii.figures.panels import MOST_PANELS, several_axes, show_picture

        shape_HW, planes = self.grid.shape_HW, evenly_chosen(len(self.planes), MOST_PANELS)
        panels = several_axes(axes, len(planes), shape_HW)
        step_px = block_px(self.counts.shape[1:3], PANEL_PX)
        for panel, plane, image in zip(panels, planes, self._pictures(planes, step_px, kept), strict=True):
            show_picture(
                panel, image, shape_HW, f"section at {self.z_mm[plane]:.5g} mm", step_px / self.subpixel
            )
        return panels, planes

    def _thumbnails_of(self, kept: np.ndarray | None) -> dict[str, str]:
        """Small pictures for notebooks by caption, only of points that are `kept`, bool (Z, H, W)."""
        from pcii.figures.exposure import MOST_THUMBNAILS, THUMBNAIL_PX, block_px
        from pcii.figures.pictures import data_uri

        planes = evenly_chosen(len(self.planes), MOST_THUMBNAILS)
        images = self._pictures(planes, block_px(self.counts.shape[1:3], THUMBNAIL_PX), kept)
        return {f"{z:.5g} mm": data_uri(image) for z, image in zip(self.z_mm[planes], images, strict=True)}

    def _pictures(self, planes: Sequence[int], step_px: int, kept: np.ndarray | None) -> list[np.ndarray]:
        """8-bit pictures of sections in blocks of `step_px` x `step_px` voxels, at a common exposure."""
        from pcii.figures.exposure import exposed

        def light(plane: int) -> tuple[np.ndarray, np.ndarray]:
            sums, samples = self.counts[plane], self.coverage[plane]
            if kept is not None:
                sums = sums * kept[plane][..., None]
            if self.cfa is None:
                return sums, samples
            return by_colour(sums[..., 0], self.cfa), by_colour(samples[..., 0], self.cfa)

        return exposed(map(light, planes), step_px)

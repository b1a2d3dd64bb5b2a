"""Datasets: counts, truth and radiance of a dataset folder, each checked when it is read.

    manifest.json            recipe as resolved, versions, timings, every file with size and SHA-256
    counts.zarr/             events k, l, i, j, n (event,) or dense counts (K, L, H, W)
    counts.zarr/frame        (photon,) the frame of each count, on request
    counts-300.zarr/         those of a smaller budget, if photons.nested asks for it
    photon_truth.zarr/       object_id, z_mm (photon,) of each photon's first hit, in the events' order
    truth.zarr/              maps (H, W) of the virtual centre, and of every view on request
    radiance/view_kk_ll.exr  float32, on request; one channel Y for a mosaic, else R, G, B
    arrays.zip               in place of the .zarr folders, where many small files would be a burden

The archive is a ZIP file as the zip stores of Zarr are: without compression, since chunks are compressed
already. Its members are in order and without dates, so that the same arrays make the same bytes.

A dataset without a manifest is unfinished, a file whose hash differs is damaged, and what is not listed is
not read.
"""

import io
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import InputError, ShortForm, listed, times
from pcii.store.folders import (
    MANIFEST,
    REMEDY,
    DatasetManifest,
    Files,
    check_size,
    lists_part,
    read_listed,
    read_manifest,
    read_part,
)
from pcii.store.stored_arrays import (
    ARRAYS,
    COUNTS_LABELS,
    PHOTON_TRUTH_LABELS,
    TRUTH_LABELS,
    Label,
    read_array,
    read_exr,
)
from pcii.types import (
    EXPOSURE,
    FULL_LIGHT,
    OPTIONAL_MAPS,
    CameraGrid,
    Light,
    PhotonCounts,
    PhotonTruth,
    Truth,
    Views,
)

COUNTS = "counts.zarr"
FRAME = "frame"
"""Array of the counts that has the frame of each."""
TRUTH = "truth.zarr"
PHOTON_TRUTH = "photon_truth.zarr"
RADIANCE = "radiance"
SAMPLE = Path(__file__).resolve().parents[1] / "_shipped" / "sample"


def radiance_name(k: int, l: int) -> str:
    """Path of the radiance of a view in the dataset."""
    return f"{RADIANCE}/view_{k:02d}_{l:02d}.exr"


def nested_name(part: str, budget: float | None) -> str:
    """Name of an array group for a nested photon budget; unchanged for None.

    >>> nested_name("counts.zarr", 300.0)
    'counts-300.zarr'
    """
    if budget is None:
        return part
    stem, suffix = part.rsplit(".", 1)
    return f"{stem}-{budget:.12g}.{suffix}"


class StoredRadiance:
    """Radiance (K, L, H, W, C), float32: [k, l] reads one view (H, W, C), `np.asarray` all of them."""

    dtype = np.dtype(np.float32)

    def __init__(self, root: Path, files: Files, shape: tuple[int, int, int, int, int]) -> None:
        self.shape = shape
        self._root, self._files = root, files

    def __getitem__(self, index: tuple[int, int], /) -> np.ndarray:
        K, L = self.shape[:2]
        if index not in np.ndindex(K, L):
            raise InputError(f"radiance: read one of {K} x {L} views by [k, l], or all by numpy.asarray")
        name = radiance_name(*index)
        content = read_listed(self._root, name, self._files[name])
        return read_exr(self._root / name, self.shape[2:], content)

    def __array__(self, dtype: np.dtype | None = None, copy: bool | None = None) -> np.ndarray:
        """All views, read into memory; raises `ValueError` if NumPy asks for them without a copy."""
        if copy is False:
            raise ValueError("radiance: it is on disk, and only a copy can be in memory")
        views = np.empty(self.shape, self.dtype if dtype is None else dtype)
        for k, l in np.ndindex(*self.shape[:2]):
            views[k, l] = self[k, l]
        return views


@dataclass(frozen=True, eq=False, repr=False)
class Dataset(ShortForm):
    """A finished dataset folder, whose arrays are read, and their hashes checked, on first use."""

    path: Path
    manifest: DatasetManifest
    choice: Light | None = None
    """The light of a nested budget, or full light; None for all photons or, without any, the radiance."""

    @property
    def grid(self) -> CameraGrid:
        """The cameras."""
        return self.manifest.grid

    @property
    def cfa(self) -> str | None:
        """Bayer pattern; None for a monochrome sensor."""
        return self.manifest.cfa

    def _facts(self) -> dict[str, object]:
        parts = {"counts": COUNTS, "truth": TRUTH, "radiance": RADIANCE}
        return {
            "name": self.name,
            "shape": times(self.grid.shape_KLHW),
            "cfa": self.cfa,
            "budgets": listed(self._counted) if self._counted else None,
            "z_mm": listed(self.analysis.get("z_mm") or ()),
            "has": listed([name for name, part in parts.items() if self.has(part)]),
        }

    @cached_property
    def _counted(self) -> tuple[Light, ...]:
        """The lights that photons are stored of: nested budgets, then that of all photons."""
        if not self.has(COUNTS):
            return ()
        stated = self.manifest.recipe.get("photons", {})  # the datasets of others state their budget alone
        scope = stated.get("scope") or "view"
        most = self.manifest.photon_budget or stated.get("budget")
        if scope == "exposure" or most is None:
            return (EXPOSURE,)
        return tuple(Light(photons, scope) for photons in (*sorted(stated.get("nested") or []), most))

    @property
    def lights(self) -> tuple[Light, ...]:
        """All its lights: nested budgets, that of all photons, and full light if it has radiance."""
        return (*self._counted, *([FULL_LIGHT] if self.has(RADIANCE) else []))

    @property
    def light(self) -> Light:
        """The light of `counts`, or full light if there are none."""
        return self.choice or (self._counted or (FULL_LIGHT,))[-1]

    def at_light(self, light: Light) -> "Dataset":
        """The dataset with the photons of one of its `lights`, or with its radiance alone.

        The scope is its own, whatever that of `light`. Raises `InputError` for a light that is not there.
        """
        for stored in self.lights:
            if str(stored) == str(light):
                return replace(self, choice=None if stored in self._counted[-1:] else stored)
        known = ", ".join(map(str, self.lights)) or "none"
        raise InputError(f"{self.path}: has no budget {light}; there are {known}")

    @property
    def name(self) -> str:
        """Name of the dataset's folder."""
        return self.path.resolve().name

    @property
    def analysis(self) -> Mapping[str, Any]:
        """Depths (`z_mm`) and depth range (`z_range_mm`) that the recipe suggests; empty if none."""
        return self.manifest.analysis or {}

    def _part(self, name: str) -> str:
        """Name of the counts, or of their truth, at this light."""
        return nested_name(name, self.choice and self.choice.photons)

    @property
    def has_counts(self) -> bool:
        """Whether the dataset has photon counts; without them it may have radiance."""
        return self.light != FULL_LIGHT and self.has(self._part(COUNTS))

    @cached_property
    def counts(self) -> PhotonCounts:
        """The photon counts; raises `InputError` if the dataset has none."""
        part = self._part(COUNTS)
        if not self.has_counts:
            raise InputError(
                f"{self.path}: this light has no photon counts; import the images with --photons N, or "
                "generate the dataset with products.counts = true"
            )
        names = ("dense",) if self.has(f"{part}/dense") else tuple("klijn")
        if self.has(f"{part}/{FRAME}"):
            names += (FRAME,)
        arrays = self._arrays(part, COUNTS_LABELS, names)
        film: dict[str, Any] = {"grid": self.grid, "cfa": self.cfa}
        film |= {"frames": self.manifest.frames, "bits": self.manifest.bits}
        try:
            if "dense" in arrays:
                return PhotonCounts.from_dense(arrays["dense"], **film)
            return PhotonCounts.from_events(**arrays, **film)
        except InputError as fault:
            raise InputError(f"{self.path / part}: {fault}") from None

    @cached_property
    def truth(self) -> Truth | None:
        """Ground truth of the virtual centre camera, or None if the dataset has none."""
        if not self.has_truth_array("z_mm"):
            return None
        optional = tuple(name for name in OPTIONAL_MAPS if self.has_truth_array(name))
        arrays = self._arrays(TRUTH, TRUTH_LABELS, ("z_mm", "object_id", *optional))
        photons = self._photon_truth()
        try:
            return Truth(
                **arrays,
                names=self.manifest.objects,
                photons=photons,
                unscored=frozenset(self.manifest.unscored),
                are_objects_known=self.manifest.are_objects_known,
            )
        except InputError as fault:
            raise InputError(f"{self.path / TRUTH}: {fault}") from None

    def has_truth_array(self, name: str) -> bool:
        """Whether the dataset has this array of `truth.zarr`; docs/dataset.md lists them."""
        return self.has(f"{TRUTH}/{name}")

    def truth_array(self, name: str) -> np.ndarray:
        """An array of `truth.zarr` by name, such as `view_z_mm`; raises `InputError` if it is not there."""
        if name not in TRUTH_LABELS or not self.has_truth_array(name):
            raise InputError(f"{self.path}: there is no {name!r} in its {TRUTH}")
        return self._arrays(TRUTH, TRUTH_LABELS, (name,))[name]

    def _photon_truth(self) -> PhotonTruth | None:
        part = self._part(PHOTON_TRUTH)
        if not self.has_counts or not self.has(part):
            return None
        origins = self._arrays(part, PHOTON_TRUTH_LABELS, ("object_id", "z_mm"))
        events = self.counts.events
        if {array.shape for array in origins.values()} != {(self.counts.total,)}:
            raise InputError(f"{self.path / part}: does not belong to the counts beside it")
        pixels = {name: getattr(events, name).repeat(events.n) for name in "klij"}
        return PhotonTruth(**pixels, **origins)

    @cached_property
    def views(self) -> Views | None:
        """Radiance of the views, read from disk one view at a time, or None if the dataset has none."""
        if not self.has(RADIANCE):
            return None
        channels = self.manifest.radiance_channels
        if channels is None:
            raise InputError(f"{self.path / MANIFEST}: radiance_channels: missing, though it has {RADIANCE}")
        radiance = StoredRadiance(self.path, self.manifest.files, (*self.grid.shape_KLHW, channels))
        return Views(radiance, self.grid, self.cfa if channels == 1 else None)

    @property
    def counts_or_views(self) -> PhotonCounts | Views:
        """The photon counts or, of a dataset without, the radiance; `InputError` if there is neither."""
        views = None if self.has_counts else self.views
        return self.counts if views is None else views

    def has(self, part: str) -> bool:
        """Whether the manifest lists the file `part`, or files of a folder of this name, packed or not."""
        return lists_part([*self.manifest.files, *self.manifest.packed], part)

    @cached_property
    def _packed(self) -> dict[str, bytes]:
        """Content of all packed files by their paths."""
        archive = io.BytesIO(read_listed(self.path, ARRAYS, self.manifest.files[ARRAYS]))
        try:
            with zipfile.ZipFile(archive) as members:
                return {name: members.read(name) for name in self.manifest.packed}
        except (KeyError, zipfile.BadZipFile) as fault:
            raise InputError(f"{self.path / ARRAYS}: cannot be read ({fault}); {REMEDY}") from None

    def _arrays(
        self, part: str, labels: Mapping[str, Label], names: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        K, L, H, W = self.grid.shape_KLHW
        sizes = {"camera_row": K, "camera_col": L, "row": H, "col": W, "axis": 3, "direction": 3}
        arrays = dict[str, np.ndarray]()
        for name in names:
            path = f"{part}/{name}"
            files = self._packed if self.manifest.packed else read_part(self.path, self.manifest.files, path)
            arrays[name] = read_array(self.path, path, files, labels[name], sizes)
        return arrays


def open_dataset(path: str | Path) -> Dataset:
    """Open a dataset folder, after a check that every listed file exists and has the listed size.

    Contents are compared with their SHA-256 when they are read; files that the manifest does not list are
    ignored. Raises `InputError` for a folder that is no finished dataset, a manifest that was changed since
    it was written or lacks a view or the archive, or a file that is missing or truncated.

    >>> open_dataset(SAMPLE).counts.total
    50202
    """
    root = Path(path)
    manifest = read_manifest(root)
    needed = [ARRAYS] if manifest.packed else []
    if lists_part(manifest.files, RADIANCE):
        needed += [radiance_name(k, l) for k, l in np.ndindex(manifest.grid.rows, manifest.grid.cols)]
    for name in needed:
        if name not in manifest.files:
            raise InputError(f"{root / MANIFEST}: files: {name} is missing; {REMEDY}")
    for name, entry in manifest.files.items():
        check_size(root, name, entry)
    return Dataset(root, manifest)


def sample() -> Dataset:
    """A small dataset of the paper's ball and bird, with photon counts, truth and radiance.

    It is that of `data_recipes/sample.toml`: 5 x 5 views of 96 x 144 pixels, GRBG, 2000 photons in each. It
    is read where the package is installed; `pcii sample -o DIR` copies it.

    >>> dataset = sample()
    >>> dataset.grid.shape_KLHW, dataset.cfa, dataset.analysis["z_mm"]
    ((5, 5, 96, 144), 'GRBG', [540.0, 620.0])
    >>> dataset.truth.names
    {1: 'ball', 2: 'bird'}
    """
    return open_dataset(SAMPLE)

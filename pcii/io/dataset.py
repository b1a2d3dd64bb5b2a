"""Opening a dataset folder: counts, truth and radiance as the package's types, checked as read."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.short_form import Brief, listed, times
from pcii.core.camera_grid import CameraGrid
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.truth import PhotonTruth, Truth
from pcii.io.dataset_layout import (
    COUNTS,
    COUNTS_LABELS,
    MANIFEST,
    PHOTON_TRUTH,
    PHOTON_TRUTH_LABELS,
    RADIANCE,
    REMEDY,
    TRUTH,
    TRUTH_LABELS,
    lists_part,
    nested_name,
    radiance_name,
    read_manifest,
)
from pcii.io.sealed_json import check_file
from pcii.io.stored_radiance import StoredRadiance
from pcii.io.zarr_groups import Label, read_array

MORE_TRUTH = ("normal", "coverage", "visible_views")
"""Maps of the truth that a dataset may lack: old ones do."""


@dataclass(frozen=True, eq=False, repr=False)
class Dataset(Brief):
    """A finished dataset folder; its parts are read, and their hashes checked, on first use."""

    path: Path
    manifest: Mapping[str, Any]
    grid: CameraGrid
    cfa: str | None
    budget: float | None = None
    """Nested photon budget that `counts` are of; None for the recipe's own."""

    def _facts(self) -> dict[str, object]:
        parts = {"counts": COUNTS, "truth": TRUTH, "radiance": RADIANCE}
        return {
            "name": self.name,
            "shape": times(self.grid.shape_KLHW),
            "cfa": self.cfa,
            "budgets": listed([budget or "exposure" for budget in self.budgets]),
            "z_mm": listed(self.analysis.get("z_mm") or ()),
            "has": listed([name for name, part in parts.items() if self.has(part)]),
        }

    @property
    def budgets(self) -> tuple[float | None, ...]:
        """Photon budgets that it has counts of: nested ones, then the recipe's own; None for an exposure."""
        own = self.manifest.get("recipe", {}).get("photons", {})
        whole = None if own.get("scope") == "exposure" else own.get("budget")
        return (*sorted(own.get("nested") or []), whole)

    def at_budget(self, budget: float | None) -> "Dataset":
        """The same dataset with the photons of a smaller, nested budget; `InputError` if it has none."""
        *nested, whole = self.budgets
        if budget == whole:
            return replace(self, budget=None)
        if budget is None or budget not in nested:
            known = ", ".join(f"{n:g}" for n in (whole, *nested) if n is not None)
            asked = "none" if budget is None else f"{budget:g}"
            raise InputError(f"{self.path}: no photons of budget {asked} here; there are {known or 'none'}")
        return replace(self, budget=budget)

    @property
    def name(self) -> str:
        """Name of the dataset's folder."""
        return self.path.resolve().name

    @property
    def analysis(self) -> Mapping[str, Any]:
        """Depths (`z_mm`) and depth range (`z_range_mm`) that the recipe suggests, if it does."""
        return self.manifest.get("analysis") or {}

    @property
    def _counts(self) -> str:
        return nested_name(COUNTS, self.budget)

    @cached_property
    def counts(self) -> PhotonCounts:
        """The photon counts; `InputError` if the recipe asked for none."""
        part = self._counts
        if not self.has(part):
            raise InputError(f"{self.path}: this dataset has no counts; its recipe left them out")
        names = ("dense",) if self.has(f"{part}/dense") else tuple("klijn")
        arrays = self._arrays(part, COUNTS_LABELS, names)
        try:
            if "dense" in arrays:
                return PhotonCounts.from_dense(arrays["dense"], self.grid, cfa=self.cfa)
            return PhotonCounts.from_events(**arrays, grid=self.grid, cfa=self.cfa)
        except InputError as fault:
            raise InputError(f"{self.path / part}: {fault}") from None

    @cached_property
    def truth(self) -> Truth | None:
        """Depth and object of every pixel of the virtual centre, or None where it is not known."""
        if not self.has(f"{TRUTH}/z_mm"):
            return None
        more = tuple(name for name in MORE_TRUTH if self.has(f"{TRUTH}/{name}"))
        arrays = self._arrays(TRUTH, TRUTH_LABELS, ("z_mm", "object_id", *more))
        names = {int(key): value for key, value in self.manifest.get("objects", {}).items()}
        photons = self._photon_truth()
        try:
            return Truth(**arrays, names=names, photons=photons)
        except InputError as fault:
            raise InputError(f"{self.path / TRUTH}: {fault}") from None

    def _photon_truth(self) -> PhotonTruth | None:
        part = nested_name(PHOTON_TRUTH, self.budget)
        if not self.has(part):
            return None
        known = self._arrays(part, PHOTON_TRUTH_LABELS, ("object_id", "z_mm"))
        events = self.counts.events
        if known["z_mm"].shape != (self.counts.total,) or known["object_id"].shape != (self.counts.total,):
            raise InputError(f"{self.path / part}: does not belong to the counts beside it")
        where = {name: getattr(events, name).repeat(events.n) for name in "klij"}
        return PhotonTruth(**where, **known)

    @cached_property
    def views(self) -> Views | None:
        """Radiance of the views, read from disk one view at a time, or None if not stored."""
        if not self.has(RADIANCE):
            return None
        channels = self.manifest.get("radiance_channels")
        if channels is None:
            raise InputError(
                f"{self.path / MANIFEST}: radiance_channels: missing, though it lists {RADIANCE}"
            )
        cfa = self.cfa if channels == 1 else None
        shape = (*self.grid.shape_KLHW, channels)
        return Views(StoredRadiance(shape, lambda k, l: self.check(radiance_name(k, l))), self.grid, cfa)

    def has(self, part: str) -> bool:
        """Whether the manifest lists files under `part`."""
        return lists_part(self.manifest["files"], part)

    def check(self, name: str, *, content: bool = True) -> Path:
        """Path of a listed file, after its size (and hash, if `content`) were compared."""
        entry = self.manifest["files"].get(name)
        if entry is None:
            raise InputError(f"{self.path}: the manifest lists no {name}")
        check_file(self.path, name, entry, REMEDY, content=content)
        return self.path / name

    def _arrays(
        self, part: str, labels: Mapping[str, Label], names: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        K, L, H, W = self.grid.shape_KLHW
        sizes = {"camera_row": K, "camera_col": L, "row": H, "col": W, "axis": 3, "direction": 3}
        files = self.manifest["files"]
        return {
            name: read_array(self.path, f"{part}/{name}", files, labels[name], sizes, REMEDY)
            for name in names
        }


def open_dataset(path: str | Path) -> Dataset:
    """Open a dataset folder; every listed file must be there and have the size it was written with.

    Contents are compared with their SHA-256 when they are read. What the manifest does not list is not
    read. Raises `InputError` for a folder that is no finished dataset, a manifest that was changed since it
    was written, or a file that is missing or truncated.
    """
    root = Path(path)
    manifest = read_manifest(root)
    for name, entry in manifest["files"].items():
        check_file(root, name, entry, REMEDY, content=False)
    return Dataset(root, manifest, CameraGrid(**manifest["grid"]), manifest["cfa"])

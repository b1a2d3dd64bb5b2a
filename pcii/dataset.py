"""Opening a dataset folder: counts, truth and radiance as the package's types, checked as read."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pcii.bayer import check_cfa
from pcii.errors import InputError
from pcii.photon_counts import PhotonCounts
from pcii.store import (
    COUNTS,
    MANIFEST,
    PHOTON_TRUTH,
    RADIANCE,
    TRUTH,
    check_file,
    nested_name,
    radiance_name,
    read_exr,
    read_manifest,
)
from pcii.types import CameraGrid, PhotonTruth, Truth, Views

MORE_TRUTH = ("normal", "coverage", "visible_views")
"""Maps of the truth that a dataset may lack: old ones do."""


@dataclass(frozen=True, eq=False)
class Dataset:
    """A finished dataset folder; its parts are read, and their hashes checked, on first use."""

    path: Path
    manifest: Mapping[str, Any]
    grid: CameraGrid
    cfa: str | None
    budget: float | None = None
    """Nested photon budget that `counts` are of; None for the recipe's own."""

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
        arrays = self._arrays(self._counts, "counts")
        if "dense" in arrays:
            return PhotonCounts.from_dense(arrays["dense"], self.grid, cfa=self.cfa)
        missing = set("klijn") - set(arrays)
        if missing:
            raise InputError(f"{self.path / self._counts}: lacks the array {min(missing)!r}")
        columns = {name: arrays[name] for name in "klijn"}
        return PhotonCounts.from_events(**columns, grid=self.grid, cfa=self.cfa)

    @cached_property
    def truth(self) -> Truth | None:
        """Depth and object of every pixel of the virtual centre, or None where it is not known."""
        if not self.has(f"{TRUTH}/z_mm"):
            return None
        more = tuple(name for name in MORE_TRUTH if self.has(f"{TRUTH}/{name}"))
        arrays = self._arrays(TRUTH, "truth", only=("z_mm", "object_id", *more))
        names = {int(key): value for key, value in self.manifest.get("objects", {}).items()}
        return Truth(**arrays, names=names, photons=self._photon_truth())

    def _photon_truth(self) -> PhotonTruth | None:
        part = nested_name(PHOTON_TRUTH, self.budget)
        if not self.has(part):
            return None
        known = self._arrays(part, "photon truth", only=("object_id", "z_mm"))
        events = self.counts.events
        where = {name: getattr(events, name).repeat(events.n) for name in "klij"}
        if known["z_mm"].shape != where["k"].shape:
            raise InputError(f"{self.path / part}: does not belong to the counts beside it")
        return PhotonTruth(**where, **known)

    @cached_property
    def views(self) -> Views | None:
        """Radiance of the views, read from disk one view at a time, or None if not stored."""
        if not self.has(RADIANCE):
            return None
        channels = int(self.manifest["radiance_channels"])
        cfa = self.cfa if channels == 1 else None
        return Views(_ExrStack(self, channels), self.grid, cfa)

    def has(self, part: str) -> bool:
        """Whether the manifest lists files under `part`."""
        return any(name == part or name.startswith(f"{part}/") for name in self.manifest["files"])

    def check(self, name: str, *, content: bool = True) -> Path:
        """Path of a listed file, after its size (and hash, if `content`) were compared."""
        entry = self.manifest["files"].get(name)
        if entry is None:
            raise InputError(f"{self.path}: the manifest lists no {name}")
        check_file(self.path, name, entry, content=content)
        return self.path / name

    def _arrays(self, part: str, product: str, only: tuple[str, ...] | None = None) -> dict[str, np.ndarray]:
        import zarr

        if not self.has(part):
            raise InputError(f"{self.path}: this dataset has no {product}; its recipe left them out")
        keep = [part] if only is None else [f"{part}/{name}" for name in only]
        for name in self.manifest["files"]:
            if any(name.startswith(f"{prefix}/") for prefix in keep):
                self.check(name)
        group = zarr.open_group(self.path / part, mode="r", zarr_format=3)
        names = list(group.array_keys()) if only is None else only
        try:
            return {name: np.asarray(group[name][...]) for name in names}  # type: ignore[index]
        except KeyError as fault:
            raise InputError(f"{self.path / part}: lacks the array {fault}") from None


class _ExrStack:
    """Radiance (K, L, H, W, C) on disk, one EXR a view, read when indexed by [k, l]."""

    def __init__(self, dataset: Dataset, channels: int) -> None:
        self._dataset = dataset
        self.shape = (*dataset.grid.shape_KLHW, channels)
        self.dtype = np.dtype(np.float32)

    def __getitem__(self, index: tuple[int, int], /) -> np.ndarray:
        path = self._dataset.check(radiance_name(*index))
        image = read_exr(path)
        if image.shape != self.shape[2:]:
            raise InputError(f"{path}: expected an image {self.shape[2:]}, got {image.shape}")
        return image


def open_dataset(path: str | Path) -> Dataset:
    """Open a dataset folder; every listed file must be there and have the size it was written with.

    Contents are compared with their SHA-256 when they are read. Raises `InputError` for a folder
    that is no finished dataset, or a file that is missing or truncated.
    """
    root = Path(path)
    manifest = read_manifest(root)
    try:
        grid = CameraGrid(**manifest["grid"])
        cfa, files = check_cfa(manifest["cfa"]), manifest["files"]
        for name, entry in files.items():
            check_file(root, name, entry, content=False)
    except (KeyError, TypeError, AttributeError) as fault:
        raise InputError(f"{root / MANIFEST}: something is missing or misspelt in it: {fault}") from None
    return Dataset(root, manifest, grid, cfa)

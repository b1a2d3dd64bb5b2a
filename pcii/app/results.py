"""The folder of results that commands write and later commands read.

results.json             which dataset it belongs to, every file with size and SHA-256, its own checksum
sections.zarr/           z_mm, counts, coverage
segmented_<method>.zarr/ z_mm, in_focus; photon_in_focus where the method decides about single photons
depth.zarr/              z_mm, confidence
score.json               as in `Score.to_dict`
*.png, report.html       pictures and the report

A replacement is written completely under a temporary name. Then the old entry is removed from results.json,
the replacement renamed, and its entry added: a kill at any time leaves the old results, none, or the new
ones.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError
from pcii.base.safe_files import (
    locked,
    named_in_errors,
    replace_folder,
    sweep_temporaries,
    sync_folder,
    temporary_folder,
    write_json_safely,
)
from pcii.core.array_labels import DEPTH_LABELS, SECTIONS_LABELS, SEGMENTED_LABELS, Label
from pcii.core.estimates import DepthMap, Score, Segmented
from pcii.core.section_stack import Sections
from pcii.io.dataset import Dataset
from pcii.io.dataset_layout import lists_part
from pcii.io.results_list import RESULTS, read_results, write_results
from pcii.io.sealed_json import list_files
from pcii.io.zarr_groups import read_array, write_arrays
from pcii.sections.reconstruction import reconstruct

REMEDY = "make it again"
LOCK = ".results.lock"


@dataclass(frozen=True)
class Results:
    """A folder of results of one dataset and photon budget."""

    path: Path
    dataset: Dataset

    @property
    def _origin(self) -> dict[str, Any]:
        """Dataset and budget that the results belong to, as in results.json."""
        data = self.dataset
        return {"dataset": data.name, "identity": data.manifest.get("identity"), "budget": data.budget}

    def check(self) -> None:
        """Raise `InputError` unless the folder is new, empty, or has results of this dataset and budget."""
        out = self.path
        if out.exists() and not out.is_dir():
            raise InputError(f"{out}: this is a file; name a folder for the results")
        if out.resolve() == self.dataset.path.resolve():
            raise InputError(f"{out}: this is the dataset itself; name another folder for the results")
        if not (out / RESULTS).exists():
            if out.is_dir() and any(path.name != LOCK for path in out.iterdir()):
                raise InputError(f"{out}: holds something else; name a new or empty folder")
            return
        held = read_results(out)
        if {name: held[name] for name in self._origin} != self._origin:
            raise InputError(
                f"{out}: holds the results of another dataset or photon budget; name a new or empty folder"
            )

    @contextmanager
    def writing(self) -> Iterator["Results"]:
        """Make the folder and lock it against other writers until the end of the block."""
        self.check()
        self.path.mkdir(parents=True, exist_ok=True)
        with named_in_errors(self.path), locked(self.path / LOCK, wait=True):
            try:
                self.check()
                sweep_temporaries(self.path)
                if not (self.path / RESULTS).exists():
                    self._list({})
                yield self
            finally:
                (self.path / LOCK).unlink(missing_ok=True)

    @contextmanager
    def replacing(self, name: str) -> Iterator[Path]:
        """Path at which to write the new file or folder `name`; it is renamed at the end of the block."""
        target = self.path / name
        with temporary_folder(target) as temporary:
            new = temporary / name
            yield new
            files = read_results(self.path)["files"]
            remaining = {path: entry for path, entry in files.items() if not lists_part([path], name)}
            if len(remaining) < len(files):
                self._list(remaining)
            if new.is_dir():
                replace_folder(new, target)
            else:
                new.replace(target)
                sync_folder(self.path)
            self._list(remaining | list_files(self.path, [name]))

    def _list(self, files: Mapping[str, Any]) -> None:
        write_results(self.path, {**self._origin, "files": files})

    def save_sections(self, sections: Sections) -> Path:
        """Write the counts and the coverage, whose quotient is the estimate."""
        arrays = {"z_mm": sections.z_mm, "counts": sections.counts, "coverage": sections.coverage}
        pattern = {} if sections.cfa is None else {"cfa": sections.cfa}
        labels = SECTIONS_LABELS
        if sections.counts.dtype.kind == "f":
            labels = labels | {"counts": replace(labels["counts"], unit="radiance")}
        return self._save("sections.zarr", arrays, labels, pattern)

    def save_segmented(self, focus: Segmented) -> Path:
        """Write the in-focus masks of one method, and `photon_in_focus` if the method decides it."""
        arrays = {"z_mm": focus.z_mm, "in_focus": focus.in_focus}
        if focus.photon_in_focus is not None:
            arrays["photon_in_focus"] = focus.photon_in_focus
        return self._save(
            f"segmented_{focus.method}.zarr", arrays, SEGMENTED_LABELS, {"method": focus.method}
        )

    def save_depth(self, depth: DepthMap) -> Path:
        """Write the depth map and its confidence."""
        return self._save("depth.zarr", {"z_mm": depth.z_mm, "confidence": depth.confidence}, DEPTH_LABELS)

    def save_score(self, result: Score) -> Path:
        """Write score.json."""
        with self.replacing("score.json") as path:
            write_json_safely(path, result.to_dict())
        return self.path / "score.json"

    def _save(
        self,
        name: str,
        arrays: Mapping[str, np.ndarray],
        labels: Mapping[str, Label],
        attributes: Mapping[str, Any] | None = None,
    ) -> Path:
        with self.replacing(name) as path:
            write_arrays(path, arrays, labels, attributes)
        return self.path / name

    def load_segmented(self) -> list[Segmented]:
        """The in-focus masks of every method in the folder; their sections are reconstructed again."""
        files = read_results(self.path)["files"]
        groups = {name.split("/")[0] for name in files}
        segmented: list[Segmented] = []
        sections: dict[bytes, Sections] = {}
        for group in sorted(
            name for name in groups if name.startswith("segmented_") and name.endswith(".zarr")
        ):
            has_photons = lists_part(files, f"{group}/photon_in_focus")
            names = ("z_mm", "in_focus", *(["photon_in_focus"] if has_photons else []))
            arrays = {name: self._read(f"{group}/{name}", files, SEGMENTED_LABELS[name]) for name in names}
            photons = arrays.pop("photon_in_focus", None)
            if photons is not None and photons.shape[-1] != self.dataset.counts.events.n.size:
                raise InputError(f"{self.path / group}: its photon_in_focus is of other counts; {REMEDY}")
            method = group.removeprefix("segmented_").removesuffix(".zarr")
            try:
                depths = arrays["z_mm"].tobytes()
                if depths not in sections:
                    sections[depths] = reconstruct(self.dataset.counts, arrays["z_mm"])
                in_focus = arrays["in_focus"]
                segmented.append(Segmented(in_focus, method, sections[depths], photon_in_focus=photons))
            except InputError as fault:
                raise InputError(f"{self.path / group}: {fault}; {REMEDY}") from None
        return segmented

    def load_depth(self) -> DepthMap | None:
        """The depth map in the folder, or None."""
        files = read_results(self.path)["files"]
        if not lists_part(files, "depth.zarr"):
            return None
        return DepthMap(**{n: self._read(f"depth.zarr/{n}", files, DEPTH_LABELS[n]) for n in DEPTH_LABELS})

    def _read(self, name: str, files: Mapping[str, Any], label: Label) -> np.ndarray:
        grid = self.dataset.grid
        sizes = {"row": grid.height, "col": grid.width}
        return read_array(self.path, name, files, label, sizes, REMEDY)

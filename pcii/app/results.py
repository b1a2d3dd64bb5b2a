"""The folder of results that commands write and later commands read.

results.json             which dataset it belongs to, every file with size and SHA-256, its own checksum; of
                         what `pcii run` made, by what (see `pcii.app.long_steps`) and how long it took;
                         `due`, the parts that have to be made, or made again
sections.zarr/           z_mm, counts, coverage
segmented_<method>.zarr/ z_mm, in_focus; photon_in_focus where the method decides about single photons
depth.zarr/              z_mm, confidence
score.json               as in `Score.to_dict`
*.png, report.html       pictures and the report

A replacement is written completely under a temporary name. Then the old entry is removed from results.json,
the replacement renamed, and its entry added: a kill at any time leaves the old results, none, or the new
ones. `due` lists the parts that are missing or older than the others and have to be made: after a run that
was interrupted, those that it had not reached; after a command that replaced masks or depth, the scores and
the report.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
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
from pcii.sections.reconstruction import reconstruct
from pcii.store.dataset import Dataset
from pcii.store.folders import LOCK, RESULTS, RESULTS_FOLDER, list_files, lists_part, read_results
from pcii.store.zarr_groups import read_array, write_arrays
from pcii.types.array_labels import DEPTH_LABELS, SECTIONS_LABELS, SEGMENTED_LABELS, Label
from pcii.types.estimates import DepthMap, Score, Segmented
from pcii.types.section_stack import Sections

REMEDY = "make it again"
FINISH = "`pcii run` with the same options makes them, and keeps what is done"
DEPTH = "depth.zarr"
SECTIONS = "sections.zarr"
SCORE = "score.json"
REPORT = "report.html"


def masks_name(method: str) -> str:
    """Name of the folder of a method's masks."""
    return f"segmented_{method}.zarr"


@dataclass(frozen=True)
class StepRecord:
    """What a file or folder of results follows from, as a hash, and how long it took to make."""

    key: str
    seconds: float


@dataclass(frozen=True)
class Results:
    """A folder of results of one dataset and photon budget."""

    path: Path
    dataset: Dataset

    @property
    def _origin(self) -> dict[str, Any]:
        """Dataset and budget that the results belong to, as in results.json."""
        data = self.dataset
        return {"dataset": data.name, "identity": data.manifest.identity, "budget": data.budget}

    def check(self) -> None:
        """Raise `InputError` unless the folder is new, empty, or has results of this dataset and budget."""
        out = self.path
        if out.resolve() == self.dataset.path.resolve():
            raise InputError(f"{out}: this is the dataset itself; name another folder for the results")
        if RESULTS_FOLDER.guard(out) and any(
            read_results(out).get(name) != value for name, value in self._origin.items()
        ):
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
                    self._list({}, {}, ())
                yield self
            finally:
                (self.path / LOCK).unlink(missing_ok=True)

    @contextmanager
    def replacing(self, name: str, record: StepRecord | None = None) -> Iterator[Path]:
        """Path at which to write the new file or folder `name`; it is renamed at the end of the block."""
        target = self.path / name
        with temporary_folder(target) as temporary:
            new = temporary / name
            yield new
            held = read_results(self.path)
            files, made, due = held["files"], held["made"], set(held.get("due", []))
            remaining = {path: entry for path, entry in files.items() if not lists_part([path], name)}
            made = {part: how for part, how in made.items() if part != name}
            listed = list_files(temporary, [name])
            if remaining | listed != files:
                due |= {part for part in _made_from(name) if part in files}
            if len(remaining) < len(files):
                self._list(remaining, made, due | {name})
            if new.is_dir():
                replace_folder(new, target)
            else:
                new.replace(target)
                sync_folder(self.path)
            if record is not None:
                made[name] = asdict(record)
            self._list(remaining | listed, made, due - {name})

    def begin(self, parts: Iterable[str]) -> None:
        """List parts as due before the first of them is made; each is until it is made."""
        held = read_results(self.path)
        self._list(held["files"], held["made"], {*held.get("due", []), *parts})

    def keep(self, name: str) -> None:
        """Say that the part that is there already is the one to be made."""
        held = read_results(self.path)
        self._list(held["files"], held["made"], {*held.get("due", [])} - {name})

    def _list(self, files: Mapping[str, Any], made: Mapping[str, Any], due: Collection[str]) -> None:
        """Write results.json, the same whatever order the files were made in."""
        in_order = {"files": dict(sorted(files.items())), "made": dict(sorted(made.items()))}
        RESULTS_FOLDER.write(self.path, self._origin | in_order | ({"due": sorted(due)} if due else {}))

    def save_sections(self, sections: Sections) -> Path:
        """Write the counts and the coverage, whose quotient is the estimate."""
        arrays = {"z_mm": sections.z_mm, "counts": sections.counts, "coverage": sections.coverage}
        pattern = {} if sections.cfa is None else {"cfa": sections.cfa}
        labels = SECTIONS_LABELS
        if sections.counts.dtype.kind == "f":
            labels = labels | {"counts": replace(labels["counts"], unit="radiance")}
        return self._save(SECTIONS, arrays, labels, pattern)

    def save_segmented(self, focus: Segmented, record: StepRecord | None = None) -> Path:
        """Write the in-focus masks of one method, and `photon_in_focus` if the method decides it."""
        arrays = {"z_mm": focus.z_mm, "in_focus": focus.in_focus}
        if focus.photon_in_focus is not None:
            arrays["photon_in_focus"] = focus.photon_in_focus
        attributes = {"method": focus.method}
        return self._save(masks_name(focus.method), arrays, SEGMENTED_LABELS, attributes, record)

    def save_depth(self, depth: DepthMap, record: StepRecord | None = None) -> Path:
        """Write the depth map and its confidence."""
        arrays = {"z_mm": depth.z_mm, "confidence": depth.confidence}
        return self._save(DEPTH, arrays, DEPTH_LABELS, record=record)

    def save_score(self, result: Score) -> Path:
        """Write score.json."""
        with self.replacing(SCORE) as path:
            write_json_safely(path, result.to_dict())
        return self.path / SCORE

    def _save(
        self,
        name: str,
        arrays: Mapping[str, np.ndarray],
        labels: Mapping[str, Label],
        attributes: Mapping[str, Any] | None = None,
        record: StepRecord | None = None,
    ) -> Path:
        with self.replacing(name, record) as path:
            write_arrays(path, arrays, labels, attributes)
        return self.path / name

    def load_segmented(self) -> list[Segmented]:
        """The in-focus masks of every method in the folder; their sections are reconstructed again.

        Raises `InputError` if those of a method are older than a run that was not finished.
        """
        files = self._current_files()
        groups = {name.split("/")[0] for name in files}
        segmented: list[Segmented] = []
        sections: dict[bytes, Sections] = {}
        for group in sorted(
            name for name in groups if name.startswith("segmented_") and name.endswith(".zarr")
        ):
            arrays = self._masks(group, files)
            method = group.removeprefix("segmented_").removesuffix(".zarr")
            try:
                depths = arrays.pop("z_mm")
                if depths.tobytes() not in sections:
                    sections[depths.tobytes()] = reconstruct(self.dataset.counts, depths)
                segmented.append(_segmented(arrays, method, sections[depths.tobytes()]))
            except InputError as fault:
                raise InputError(f"{self.path / group}: {fault}; {REMEDY}") from None
        return segmented

    def _masks(self, group: str, files: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """`z_mm`, `in_focus` and, if the method decides it, `photon_in_focus` of a method."""
        has_photons = lists_part(files, f"{group}/photon_in_focus")
        names = ("z_mm", "in_focus", *(["photon_in_focus"] if has_photons else []))
        arrays = {name: self._read(f"{group}/{name}", files, SEGMENTED_LABELS[name]) for name in names}
        if has_photons and arrays["photon_in_focus"].shape[-1] != self.dataset.counts.events.n.size:
            raise InputError(f"{self.path / group}: its photon_in_focus is of other counts; {REMEDY}")
        return arrays

    def kept_masks(self, method: str, sections: Sections, key: str) -> tuple[Segmented, float] | None:
        """The masks of a method and how long they took, if they were made by `key` and are undamaged."""
        seconds = self._made_by(masks_name(method), key)
        if seconds is None:
            return None
        try:
            arrays = self._masks(masks_name(method), read_results(self.path)["files"])
            depths = arrays.pop("z_mm")
            same = np.array_equal(depths, sections.z_mm)
            return (_segmented(arrays, method, sections), seconds) if same else None
        except InputError:
            return None

    def kept_depth(self, key: str) -> tuple[DepthMap, float] | None:
        """The depth map and how long it took, if it was made by `key` and is undamaged."""
        seconds = self._made_by(DEPTH, key)
        try:
            depth = None if seconds is None else self._depth(read_results(self.path)["files"])
        except InputError:
            return None
        return None if depth is None or seconds is None else (depth, seconds)

    def _made_by(self, name: str, key: str) -> float | None:
        """How long it took to make a part, in s; None if it was not made by `key`, or is not there."""
        if not (self.path / RESULTS).is_file():
            return None
        made = read_results(self.path)["made"].get(name)
        return made["seconds"] if made is not None and made["key"] == key else None

    def load_depth(self) -> DepthMap | None:
        """The depth map in the folder, or None; raises `InputError` as `load_segmented` does."""
        return self._depth(self._current_files())

    def _current_files(self) -> Mapping[str, Any]:
        """Listed files; raises `InputError` if masks or a depth map are older than an unfinished run."""
        held = read_results(self.path)
        estimates = (part for part in held.get("due", []) if SCORE in _made_from(part))
        older = [part for part in estimates if lists_part(held["files"], part)]
        if older:
            raise InputError(
                f"{self.path}: {', '.join(older)}: older than the last run, which was not finished; {FINISH}"
            )
        return held["files"]

    def _depth(self, files: Mapping[str, Any]) -> DepthMap | None:
        if not lists_part(files, DEPTH):
            return None
        return DepthMap(**{n: self._read(f"{DEPTH}/{n}", files, DEPTH_LABELS[n]) for n in DEPTH_LABELS})

    def _read(self, name: str, files: Mapping[str, Any], label: Label) -> np.ndarray:
        grid = self.dataset.grid
        sizes = {"row": grid.height, "col": grid.width}
        return read_array(self.path, name, files, label, sizes, REMEDY)


def _made_from(name: str) -> tuple[str, ...]:
    """Parts that are made from `name`: of masks and depth the scores, of all these the report."""
    if name == DEPTH or name.startswith("segmented_"):
        return SCORE, REPORT
    return (REPORT,) if name in (SECTIONS, SCORE) else ()


def _segmented(arrays: Mapping[str, np.ndarray], method: str, sections: Sections) -> Segmented:
    return Segmented(arrays["in_focus"], method, sections, photon_in_focus=arrays.get("photon_in_focus"))

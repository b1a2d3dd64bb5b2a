"""The folder of results: what the commands leave behind, so that a later command can go on from it.

results.json             which dataset it belongs to
sections.zarr/           z_mm, counts, coverage
segmented_<method>.zarr/ z_mm, in_focus; photon_in_focus where the method decides about single photons
depth.zarr/              z_mm, confidence
score.json               as in `Score.to_dict`
*.png, report.html       to look at
"""

import json
from pathlib import Path

import numpy as np

from pcii.dataset import Dataset
from pcii.errors import InputError
from pcii.reconstruct import reconstruct
from pcii.store import sweep_temporaries, write_arrays_safely, write_json_safely
from pcii.types import DepthMap, Score, Sections, Segmented

MARKER = "results.json"
FORMAT = "photon-integral-imaging results"


def claim(out: Path, dataset: Dataset) -> None:
    """Make `out` the results folder of `dataset`; `InputError` if it holds something else."""
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: this is a file; name a folder for the results")
    if out.resolve() == dataset.path.resolve():
        raise InputError(f"{out}: this is the dataset itself; name another folder for the results")
    mine = {
        "format": FORMAT,
        "dataset": dataset.name,
        "identity": dataset.manifest.get("identity"),
        "budget": dataset.budget,
    }
    if out.is_dir() and any(out.iterdir()):
        held = _read_marker(out)
        if held is None:
            raise InputError(f"{out}: holds something else; name a new or empty folder")
        if held != mine:
            raise InputError(
                f"{out}: holds the results of another dataset or photon budget; name a new or empty folder"
            )
        sweep_temporaries(out)
    write_json_safely(out / MARKER, mine)


def _read_marker(out: Path) -> dict[str, object] | None:
    try:
        held = json.loads((out / MARKER).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return held if isinstance(held, dict) and held.get("format") == FORMAT else None


def save_sections(out: Path, sections: Sections) -> Path:
    """Write the sums and the coverage; the estimate is one divided by the other."""
    arrays = {"z_mm": sections.z_mm, "counts": sections.counts, "coverage": sections.coverage}
    told = {"axes": "Z, H, W, C", "unit": "photons"}
    if sections.cfa is not None:
        told["cfa"] = sections.cfa
    write_arrays_safely(out / "sections.zarr", arrays, told)
    return out / "sections.zarr"


def save_segmented(out: Path, focus: Segmented) -> Path:
    """Write the in-focus masks of one method, and its photons in focus if it tells them."""
    path = out / f"segmented_{focus.method}.zarr"
    arrays = {"z_mm": focus.z_mm, "in_focus": focus.in_focus}
    told = {"axes": "Z, H, W", "method": focus.method}
    if focus.photon_in_focus is not None:
        arrays["photon_in_focus"] = focus.photon_in_focus
        told["photon_in_focus"] = "Z, events of the counts in (k, l, i, j) order"
    write_arrays_safely(path, arrays, told)
    return path


def save_depth(out: Path, depth: DepthMap) -> Path:
    """Write the depth map and its confidence."""
    arrays = {"z_mm": depth.z_mm, "confidence": depth.confidence}
    write_arrays_safely(out / "depth.zarr", arrays, {"axes": "H, W", "z_mm": "NaN: no answer"})
    return out / "depth.zarr"


def save_score(out: Path, result: Score) -> Path:
    """Write score.json."""
    write_json_safely(out / "score.json", result.to_dict())
    return out / "score.json"


def load_segmented(out: Path, dataset: Dataset) -> list[Segmented]:
    """The in-focus masks of every method in the folder; their sections are reconstructed anew."""
    found: list[Segmented] = []
    for path in sorted(out.glob("segmented_*.zarr")):
        arrays = _read(path, ("z_mm", "in_focus"))
        sections = reconstruct(dataset.counts, arrays["z_mm"])
        method = path.stem.removeprefix("segmented_")
        photons = None
        if (path / "photon_in_focus").is_dir():
            photons = _read(path, ("photon_in_focus",))["photon_in_focus"]
            if photons.shape[-1] != dataset.counts.events.n.size:
                raise InputError(f"{path}: its photon_in_focus is of other counts; make it again")
        found.append(Segmented(arrays["z_mm"], arrays["in_focus"], method, sections, photon_in_focus=photons))
    return found


def load_depth(out: Path) -> DepthMap | None:
    """The depth map in the folder, or None."""
    path = out / "depth.zarr"
    return DepthMap(**_read(path, ("z_mm", "confidence"))) if path.is_dir() else None


def _read(path: Path, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    import zarr

    try:
        group = zarr.open_group(path, mode="r", zarr_format=3)
        return {name: np.asarray(group[name][...]) for name in names}  # type: ignore[index]
    except (KeyError, OSError, ValueError, RuntimeError) as fault:
        raise InputError(f"{path}: cannot be read ({fault}); make it again") from None

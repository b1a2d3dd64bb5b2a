"""report.html: the paper's Figures 6 and 7 and Table 1 for one dataset, with the truth beside them.

A single file without scripts or external resources, which can be mailed, archived and printed.
"""

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from pcii.app.pipeline import Outcome
from pcii.base.safe_files import write_bytes_safely
from pcii.core.section_stack import Sections
from pcii.core.truth import Truth
from pcii.evaluation.pages import page
from pcii.evaluation.summary import object_planes
from pcii.imaging import pictures as picture
from pcii.imaging.bright_regions import box_around
from pcii.io.suggested_depths import depth_range_of
from pcii.metrics.scoring import object_masks, pixel_masks
from pcii.sections.demosaicing import demosaic

PAPER_TABLE_1 = (("object 1", "1.04", "1.35"), ("object 2", "1.44", "1.05"))


def write_report(path: Path, outcome: Outcome) -> None:
    """Write the report of one run as a self-contained HTML file."""
    write_bytes_safely(path, page("report.html.j2", _content(outcome)))


def _content(outcome: Outcome) -> dict[str, Any]:
    dataset = outcome.dataset
    box = box_around(picture.interesting_part(dataset.grid, dataset.truth, outcome.focus))
    total = dataset.counts.total if dataset.has_counts else None
    manifest = dataset.manifest
    return {
        "title": manifest.get("title") or dataset.name,
        "grid": dataset.grid,
        "cfa": dataset.cfa,
        "photons_total": total,
        "photons_per_view": None if total is None else total / dataset.grid.view_count,
        "crop": f"rows {box[0].start} to {box[0].stop - 1}, columns {box[1].start} to {box[1].stop - 1}",
        "figure6": _figure6(outcome, box),
        "figure7": _figure7(outcome, box),
        "depth": _depth_panels(outcome, box),
        "depth_range": depth_range_of(dataset, outcome.sections.z_mm.tolist()),
        "z_mm": [f"{z:g}" for z in outcome.sections.z_mm],
        "score": outcome.score,
        "iou_oracle": [row["iou_oracle"] for row in outcome.score.bounds["planes"]]
        or [None] * len(outcome.score.planes),
        "depth_bounds": [r for r in outcome.score.bounds["objects"] if r["depth_sigma_px"] is not None],
        "table1": _table1(outcome.score.objects),
        "table1_holds": table1_holds(outcome.score.objects, outcome.score.planes),
        "paper_table1": PAPER_TABLE_1 if outcome.sections.z_mm.tolist() == [540.0, 620.0] else (),
        "made": _made(manifest, dataset.name, outcome.timings_s),
        "has_truth": dataset.truth is not None,
    }


def _made(manifest: Mapping[str, Any], name: str, timings_s: Mapping[str, float]) -> list[tuple[str, str]]:
    """Rows (name, value) on how the dataset and this report were made."""
    recipe, backend, photons = (manifest.get(key) or {} for key in ("recipe", "backend", "photons"))
    identity = manifest.get("identity")
    rows = [("dataset", f"{name}, identity {identity[:16]}" if identity else name)]
    rows += [(name, manifest[name]) for name in ("origin", "licence", "citation") if manifest.get(name)]
    if backend:
        samples = recipe["render"]["samples_per_pixel"]
        engine = f"Mitsuba {backend['mitsuba']}, {backend['variant']}"
        rows.append(("renderer", f"{engine}; {samples} samples per pixel, seed {recipe['seed']}"))
    if photons.get("method") == "thinning":
        value = (
            f"drawn one by one: {photons['paths']:,} light paths for {photons['total']:,} photons, where "
            f"rendering every pixel would have taken at least {photons['dense_paths_instead']:,}"
        )
        rows.append(("photons", value))
    elif photons.get("method") == "dense":
        value = (
            f"drawn from rendered views of {photons['samples_per_pixel']} samples per pixel, whose noise "
            f"adds about {100 * photons['rendering_noise']:.2g} % to the variance of the counts"
        )
        rows.append(("photons", value))
    if manifest.get("timings_s"):
        rows.append(("made in", _stages(manifest["timings_s"], 1)))
    return [
        *rows,
        ("analysed in", _stages(timings_s, 2)),
        ("software", f"photon-integral-imaging {version('photon-integral-imaging')}"),
    ]


def _stages(seconds: Mapping[str, float], digits: int) -> str:
    each = ", ".join(f"{name} {value:.{digits}f}" for name, value in seconds.items())
    return f"{sum(seconds.values()):.1f} s ({each})"


def _table1(objects: tuple[Mapping[str, Any], ...]) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for row in objects:
        bits = list(row["entropy"].values())
        lowest = min((value for value in bits if value is not None), default=None)
        rows.append({"name": row["name"], "bits": bits, "lowest": lowest})
    return rows


def table1_holds(
    objects: tuple[Mapping[str, Any], ...], planes: tuple[Mapping[str, Any], ...]
) -> bool | None:
    """Whether each object's entropy is lowest at its plane; None if none has two planes to compare."""
    plane_of = object_planes(planes)
    verdicts: list[bool] = []
    for row in objects:
        bits = {z: value for z, value in row["entropy"].items() if value is not None}
        if row["name"] in plane_of and len(bits) > 1:
            verdicts.append(min(bits, key=lambda z: bits[z]) == plane_of[row["name"]])
    return all(verdicts) if verdicts else None


def _panel(image: np.ndarray, box: tuple[slice, slice], caption: str) -> dict[str, str]:
    return {"image": picture.data_uri(image[box]), "caption": caption}


def _figure6(outcome: Outcome, box: tuple[slice, slice]) -> list[dict[str, str]]:
    """Panels of Figure 6: central view raw and demosaiced, sections, photons of one view, truth."""
    dataset = outcome.dataset
    k, l = dataset.grid.rows // 2, dataset.grid.cols // 2
    letters = iter("abcdefghijklmnopqrstuvwxyz")
    panels: list[dict[str, str]] = []
    if dataset.views is not None:
        view = dataset.views.view(k, l).astype(np.float64)
        is_mosaic = dataset.views.cfa is not None
        colour = demosaic(view[..., 0], cfa=dataset.cfa) if is_mosaic else view
        white = picture.white_level(colour, box)
        raw = picture.to_srgb8(view, white)
        panels.append(_panel(raw, box, f"({next(letters)}) view ({k}, {l}) at full light, raw"))
        if is_mosaic:
            image = picture.to_srgb8(colour, white)
            panels.append(_panel(image, box, f"({next(letters)}) the same, demosaiced (Eqs. 4–6)"))
    panels += _section_panels(outcome.full_light, box, "full light", letters)
    if dataset.has_counts:
        per_view = dataset.counts.total / dataset.grid.view_count
        panels += _section_panels(outcome.sections, box, f"{per_view:.0f} photons per view", letters)
        counts = dataset.counts.view(k, l)
        image = picture.to_srgb8(counts.astype(np.float64), max(1.0, picture.white_level(counts, box)))
        caption = f"({next(letters)}) view ({k}, {l}) at the photon budget: {counts.sum()} photons"
        panels.append(_panel(image, box, caption))
    if dataset.truth is not None:
        near, far = depth_range_of(dataset, outcome.sections.z_mm.tolist())
        image = picture.depth_image(_object_depth(dataset.truth), near, far)
        panels.append(
            _panel(image, box, f"({next(letters)}) true depth of the objects (colour scale under Depth)")
        )
    return panels


def _object_depth(truth: Truth) -> np.ndarray:
    """True depth of the objects; of everything, if the truth knows no objects."""
    has_objects = (truth.object_id > 0).any()
    return np.where(truth.object_id > 0, truth.z_mm, np.inf) if has_objects else truth.z_mm


def _section_panels(
    sections: Sections | None, box: tuple[slice, slice], light: str, letters: Any
) -> list[dict[str, str]]:
    if sections is None:
        return []
    white = max(picture.white_level(plane, box) for plane in sections.estimate)
    equation = "Eq. 2" if sections.counts.dtype.kind == "f" else "Eq. 3"
    return [
        _panel(
            picture.to_srgb8(plane, white),
            box,
            f"({next(letters)}) section at {z:g} mm, {light} ({equation})",
        )
        for z, plane in zip(sections.z_mm, sections.estimate, strict=True)
    ]


def _figure7(outcome: Outcome, box: tuple[slice, slice]) -> list[list[dict[str, str]]]:
    """Panels of Figure 7 for each method and plane: section after removal, truth, comparison."""
    truth, grid, z_mm = outcome.dataset.truth, outcome.dataset.grid, outcome.sections.z_mm
    by_object = object_masks(grid, truth, z_mm) if truth else None
    by_pixel = pixel_masks(grid, truth, z_mm) if truth else None
    white = max(picture.white_level(plane, box) for plane in outcome.sections.estimate)
    rows: list[list[dict[str, str]]] = []
    for focus in outcome.focus:
        cleaned = focus.cleaned
        for plane, z in enumerate(z_mm):
            image = picture.to_srgb8(cleaned[plane], white)
            panels = [_panel(image, box, f"{focus.method}, {z:g} mm: after removal")]
            if by_object is not None and by_pixel is not None:
                image = picture.mask_image(by_object[plane])
                image[by_object[plane] & ~by_pixel[plane]] = 130
                panels.append(_panel(image, box, f"truth at {z:g} mm"))
                image = picture.agreement_image(focus.in_focus[plane], by_object[plane])
                panels.append(_panel(image, box, "comparison"))
            rows.append(panels)
    return rows


def _depth_panels(outcome: Outcome, box: tuple[slice, slice]) -> list[dict[str, str]]:
    truth, depth = outcome.dataset.truth, outcome.depth
    near, far = depth_range_of(outcome.dataset, outcome.sections.z_mm.tolist())
    estimated = picture.depth_image(depth.z_mm, near, far, depth.confidence)
    panels = [_panel(estimated, box, "estimated depth, darker where less sure")]
    if truth is not None:
        image = picture.depth_image(_object_depth(truth), near, far)
        panels.append(_panel(image, box, "true depth of the objects"))
    image = picture.to_srgb8(depth.confidence**2.2, 1.0)
    panels.append(_panel(image, box, "confidence, from 0 (black) to 1 (white)"))
    return panels

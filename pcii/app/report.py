"""report.html: a slider through the depths, pictures of each plane, depth, scores, and how it was made.

A single file that fetches nothing, which can be mailed, archived and printed. Its pictures and text need no
script; the slider is by the one in `pcii/figures/templates/report.js`. All pictures show the same part of the
frame, in blocks if it is large. In tables a column or row of which nothing is known is left out.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pcii.app.pipeline import Outcome
from pcii.base import box_around, each_in_threads, write_bytes_safely
from pcii.evaluation import NamedMethod, depth_name, software_of
from pcii.figures import (
    DEPTH_COLOURS,
    ERROR_COLOURS,
    NOT_KNOWN,
    SHARE_COLOURS,
    agreement_image,
    block_px,
    colour_bar_uri,
    drawing_uri,
    emphasised,
    exposed,
    map_image,
    mask_image,
    photo_uri,
    photon_picture,
    render_page,
    smoothing_for,
    text_table,
)
from pcii.metrics import TrueFocus, entropy_half_widths
from pcii.sections import reconstruct
from pcii.store import machine
from pcii.types import FocalPlanes, Sections, colours_and_samples, total_disparity_px

if TYPE_CHECKING:
    from pandas import DataFrame

COARSE_PX = 320
"""Smaller pictures are enlarged with sharp pixels."""
LONGEST_PX = 640
"""Longer sides of pictures are shown in blocks of 2 x 2 pixels, or of more."""
MAX_SLIDER_PLANES = 20
"""Pictures of the slider: a report of 1024 x 1024 pixels is then below 8 MB."""
MIN_SLIDER_STEP_PX = 1.0
"""Sections whose total disparities differ by less look the same."""
SECTIONS_AT_ONCE = 4
"""Sections of the slider in memory at once; each such group reads all views."""
UNSATURATED_SHARE = 0.95
"""Share of the errors of depth that lie within the scale of their colours."""
NUMBERS = {
    "iou": "IoU",
    "everything": "IoU of all claimed",
    "precision": "precision",
    "recall": "recall",
    "f1": "F1",
    "boundary_f": "boundary F",
    "photon_precision": "photon precision",
    "photon_recall": "photon recall",
    "entropy_before": "entropy before",
    "entropy_after": "entropy after",
    "claimed_share": "claimed share",
    "false_share": "claimed falsely",
}
"""Columns of the scores after those that say what is scored, and their names."""

Panel = dict[str, str]
"""An `image` as a data URI and its `caption`; of maps also the colour `bar`."""
Scale = tuple[str, tuple[float, float], str]
"""Colour map, limits and label of a map."""


@dataclass(frozen=True, eq=False)
class Pictures:
    """The results that a report shows, rows and columns of the frame, the side of its blocks, and smoothing.

    `smoothing_px` is the standard deviation in pixels of the Gaussian, 0 for none.
    """

    outcome: Outcome
    box: tuple[slice, slice]
    step_px: int
    smoothing_px: float

    @classmethod
    def of(cls, outcome: Outcome) -> "Pictures":
        """The part around objects or claims, else all; a Gaussian by the number of photons."""
        truth, smoothing_px = outcome.dataset.truth, 0.0
        region = np.zeros(outcome.dataset.grid.shape_HW, dtype=bool)
        if truth is not None and truth.has_objects:
            region = truth.object_id > 0
        elif outcome.focus:
            region = np.any([focus.in_focus.any(axis=0) for focus in outcome.focus], axis=0)
        box = box_around(region)
        if outcome.dataset.has_counts:
            smoothing_px = smoothing_for([counts[box] for counts in outcome.sections.counts])
        return cls(outcome, box, block_px([side.stop - side.start for side in box], LONGEST_PX), smoothing_px)

    @property
    def light(self) -> str:
        """What sections show, in words."""
        if not self.outcome.dataset.has_counts:
            return "full light (Eq. 2)"
        smoothing = f", smoothed by {self.smoothing_px:g} px" if self.smoothing_px else ""
        return f"photon counts (Eq. 3){smoothing}"

    def middles(self, image: np.ndarray) -> np.ndarray:
        """The pixel in the middle of each block of an image (H, W, ...): ids and depths have no mean."""
        image, half = image[self.box], self.step_px // 2
        places = (np.arange(half, size + half, self.step_px).clip(max=size - 1) for size in image.shape[:2])
        return image[np.ix_(*places)]

    def of_sections(self, stacks: Iterable[Sections], smoothing_px: float) -> list[np.ndarray]:
        """8-bit pictures of all sections of some stacks, at the same exposure."""
        images = (
            (counts[self.box], coverage[self.box])
            for stack in stacks
            for counts, coverage in zip(stack.counts, stack.coverage, strict=True)
        )
        return exposed(images, self.step_px, smoothing_px)


def write_report(path: Path, outcome: Outcome) -> None:
    """Write the report of one run as a self-contained HTML file."""
    dataset, pictures = outcome.dataset, Pictures.of(outcome)
    rows, cols = pictures.box
    slider, first = _slider_panels(pictures)
    content = {
        "title": dataset.manifest.get("title") or dataset.name,
        "grid": dataset.grid,
        "cfa": dataset.cfa,
        "photons": dataset.counts.total if dataset.has_counts else None,
        "has_truth": dataset.truth is not None,
        "rows": rows,
        "cols": cols,
        "is_coarse": max(rows.stop - rows.start, cols.stop - cols.start) < COARSE_PX,
        "smoothing_px": pictures.smoothing_px,
        "light": pictures.light,
        "slider": slider,
        "first": first,
        "input": _input_panels(pictures),
        "planes": _plane_panels(pictures),
        "depth": _depth_panels(pictures),
        "depth_table": _depth_table(outcome),
        "entropies": _entropy_table(outcome),
        "scores": _score_table(outcome),
        "origin": text_table(_origin(outcome), ("what", "value"), words=2),
        "recipe": json.dumps(dataset.manifest.get("recipe"), indent=1, ensure_ascii=False).splitlines(),
    }
    write_bytes_safely(path, render_page("report.html.j2", content, script="report.js"))


def _origin(outcome: Outcome) -> list[tuple[str, str]]:
    """How the report and its dataset were made: names and values, folders by their names alone."""
    manifest = outcome.dataset.manifest
    methods = (*(focus.method for focus in outcome.focus), depth_name(outcome.depth_method))
    versions: dict[str, str] = {}
    for method in methods:
        versions |= software_of(NamedMethod(method)) or {}
    seconds = {name: f"{value:.2f} s" for name, value in outcome.timings_s.items()}

    def listed(words: Mapping[str, str]) -> str:
        return ", ".join(f"{name} {value}" for name, value in words.items())

    rows = [
        ("date", f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC"),
        ("machine", machine()),
        ("time", listed(seconds)),
        ("software", listed(versions)),
        ("methods", ", ".join(methods)),
        ("dataset", outcome.dataset.name),
    ]
    if outcome.dataset.choice is not None:
        rows.append(("photon budget", str(outcome.dataset.choice)))
    rows += [(key, str(manifest[key])) for key in ("origin", "licence", "citation") if manifest.get(key)]
    if manifest.get("versions"):
        rows.append(("dataset made by", listed(manifest["versions"])))
    if manifest.get("identity"):
        rows.append(("identity", manifest["identity"]))
    return rows


def _entropy_table(outcome: Outcome) -> "DataFrame":
    """Entropies of the objects at each plane with their intervals (the paper's Table 1).

    The lowest of a row stands out. There are no intervals of too few photons, nor of radiance.
    """
    objects, dataset = outcome.score.objects, outcome.dataset
    half_widths: list[dict[str, float]] = []
    if objects and dataset.has_counts and dataset.truth is not None:
        half_widths = entropy_half_widths(dataset.counts, outcome.sections, dataset.truth)
    rows: list[tuple[str, ...]] = []
    for row, half in zip(objects, half_widths or [{}] * len(objects), strict=True):
        entropy = row["entropy"]
        if None in entropy.values():
            continue
        texts = {z: f"{bits:.3f}" + (f" ± {half[z]:.3f}" if z in half else "") for z, bits in entropy.items()}
        if len(entropy) > 1:
            lowest = min(entropy.values())
            texts |= {z: emphasised(texts[z]) for z, bits in entropy.items() if bits == lowest}
        rows.append((row["name"], *texts.values()))
    return text_table(rows, ("object", *(f"{z:g} mm" for z in outcome.sections.z_mm)))


def _score_table(outcome: Outcome) -> "DataFrame":
    """Scores of every method at every plane against both kinds of truth; without truth its entropies."""
    rows = [{**row, "everything": row["everything"]["iou"]} for row in outcome.score.planes]
    words = ["plane", "method", "truth", "objects"]
    truth = outcome.dataset.truth
    if truth is None:
        words, rows = words[:2], [row for row in rows if row["truth"] == "object"]
    elif not truth.are_objects_known:
        rows = [row for row in rows if row["truth"] == truth.mask_kind]
    numbers = [key for key in NUMBERS if any(row[key] is not None for row in rows)]
    cells: list[tuple[str, ...]] = []
    for row in rows:
        objects = "all in focus" if row["truth"] == "pixel" else row["object"] or "none at this plane"
        texts = [f"{row['z_mm']:g} mm", row["method"], row["truth"], objects][: len(words)]
        cells.append((*texts, *(NOT_KNOWN if row[key] is None else f"{row[key]:.3f}" for key in numbers)))
    header = (*words, *(NUMBERS[key] for key in numbers))
    return text_table(cells, header, words=len(words))


def _depth_table(outcome: Outcome) -> "DataFrame":
    """Measures of the depth map that are known, over the objects' pixels or, without objects, over all."""
    depth, truth = outcome.score.depth, outcome.dataset.truth
    rows: list[tuple[str, str]] = []
    if truth is not None and depth["coverage"] is not None:
        pixels = "the objects' pixels" if truth.has_objects else "all pixels with a true depth"
        rows.append((f"share with an estimate, of {pixels}", f"{depth['coverage']:.1%}"))
        for limit in (1, 3):
            name = f"within {limit} px of total disparity (by the best answer of one depth everywhere)"
            of_one_depth = depth["one_depth"][f"within_{limit}px"]
            rows.append((name, f"{depth[f'within_{limit}px']:.1%} ({of_one_depth:.1%})"))
        for name, key in (
            ("median error of all of them", "median"),
            ("mean error of those with an estimate", "mae"),
            ("median signed error of those with an estimate", "bias"),
        ):
            if depth[f"{key}_mm"] is not None:
                value = f"{depth[f'{key}_mm']:.2f} mm, {depth[f'{key}_px']:.2f} px of total disparity"
                rows.append((name, value))
        scores = f"{depth['quadratic_score']:.3f} ({depth['one_depth']['quadratic_score']:.3f})"
        rows.append(("quadratic score of the confidence (of one depth)", scores))
    if depth["ece"] is not None:
        rows.append(("expected calibration error of the confidence", f"{depth['ece']:.3f}"))
    for row in outcome.score.bounds["objects"]:
        if row["depth_sigma_px"] is not None:
            bound = f"{row['depth_sigma_px']:.3f} px of total disparity"
            rows.append((f"Cramér-Rao bound on the standard deviation for {row['name']}", bound))
    return text_table(rows, ("measure", "value"), words=2)


def _slider_panels(pictures: Pictures) -> tuple[list[Panel], int]:
    """Sections through the depth range, all at one exposure, and which is at the first plane of the analysis.

    They are evenly spaced in total disparity, and their captions are depths.
    """
    outcome, grid = pictures.outcome, pictures.outcome.dataset.grid
    z_mm, (near, far) = outcome.sections.z_mm, outcome.z_range_mm
    near, far = min(near, z_mm.min()), max(far, z_mm.max())
    span_px = float(total_disparity_px(grid, near) - total_disparity_px(grid, far))
    planes = FocalPlanes.at_depths(grid, z_mm[:1])  # one camera has one section for all depths
    if span_px > 0:
        step_px = max(span_px / (MAX_SLIDER_PLANES - 1), MIN_SLIDER_STEP_PX)
        planes = FocalPlanes.between(grid, near, far, step_px).take(slice(None, None, -1))
    stacks = (
        reconstruct(outcome.dataset.counts_or_views, planes.take(slice(first, first + SECTIONS_AT_ONCE)))
        for first in range(0, len(planes), SECTIONS_AT_ONCE)
    )
    images = each_in_threads(photo_uri, pictures.of_sections(stacks, pictures.smoothing_px))
    captions = (f"{z:.4g} mm" for z in planes.z_mm)
    panels = [*map(_panel, images, captions)]
    off_px = planes.total_disparity_px - outcome.sections.planes.total_disparity_px[0]
    return panels, int(np.abs(off_px).argmin())


def _input_panels(pictures: Pictures) -> list[Panel]:
    """The view in the middle: its photons, and at full light."""
    dataset, step_px = pictures.outcome.dataset, pictures.step_px
    k, l = dataset.grid.middle_camera
    panels: list[Panel] = []
    if dataset.has_counts:
        view = dataset.counts.view(k, l)
        image = photon_picture(view[pictures.box], step_px)
        panels.append(_panel(drawing_uri(image), f"view ({k}, {l}): {view.sum()} photons"))
    if dataset.views is not None:
        sums, samples = colours_and_samples(dataset.views.view(k, l), dataset.views.cfa)
        light = sums[pictures.box], samples[pictures.box]
        panels.append(_panel(photo_uri(exposed([light], step_px)[0]), f"view ({k}, {l}) at full light"))
    return panels


def _plane_panels(pictures: Pictures) -> list[tuple[str, list[Panel], list[Panel]]]:
    """For each plane its depth, sections with their truth, and each method's removal with its comparison."""
    outcome, middles, truth = pictures.outcome, pictures.middles, pictures.outcome.dataset.truth
    true, what = None, "objects"
    if truth is not None:
        true = TrueFocus(outcome.sections.planes, truth).masks(truth.mask_kind)  # (Z, H, W)
        what = "objects" if truth.are_objects_known else "what is in focus"
    images = pictures.of_sections([outcome.sections], pictures.smoothing_px)
    lights = {pictures.light: images}
    if outcome.dataset.has_counts and outcome.full_light is not None:
        lights["full light (Eq. 2)"] = pictures.of_sections([outcome.full_light], 0.0)
    planes: list[tuple[str, list[Panel], list[Panel]]] = []
    for plane, z in enumerate(outcome.sections.z_mm):
        at = f"{z:g} mm"
        sections = [_panel(photo_uri(light[plane]), f"section at {at}, {of}") for of, light in lights.items()]
        if true is not None:
            image = mask_image(middles(true[plane]))
            sections.append(_panel(drawing_uri(image), f"truth: {what} at {at}"))
        masks: list[Panel] = []
        for focus in outcome.focus:
            claim = middles(focus.in_focus[plane])
            masks.append(_panel(photo_uri(images[plane] * claim[..., None]), f"{focus.method}, {at}"))
            if true is not None:
                image = agreement_image(claim, middles(true[plane]))
                masks.append(_panel(drawing_uri(image), f"{focus.method}, {at}, compared with the truth"))
        planes.append((at, sections, masks))
    return planes


def _depth_panels(pictures: Pictures) -> list[Panel]:
    """The depth map, the truth and the error if there is a truth, and the confidence."""
    truth, depth = pictures.outcome.dataset.truth, pictures.outcome.depth
    z_mm, confidence = pictures.middles(depth.z_mm), pictures.middles(depth.confidence)
    scale = DEPTH_COLOURS, pictures.outcome.z_range_mm, "mm"
    panels = [_map("estimated depth, paler where less sure", z_mm, scale, confidence)]
    if truth is not None:
        true_mm = pictures.middles(truth.object_z_mm)
        caption = "true depth of the objects" if truth.has_objects else "true depth"
        panels.append(_map(caption, true_mm, scale))
        is_known = np.isfinite(z_mm) & np.isfinite(true_mm)
        error = np.subtract(z_mm, true_mm, out=np.full(z_mm.shape, np.nan), where=is_known)
        limit = float(np.quantile(np.abs(error[is_known]), UNSATURATED_SHARE)) if is_known.any() else 1.0
        limit = float(f"{max(limit, 1e-3):.1e}")
        scale = ERROR_COLOURS, (-limit, limit), "mm, too far above 0"
        panels.append(_map("estimated less true depth", error, scale))
    confidence = np.where(np.isfinite(z_mm), confidence, np.nan)
    scale = SHARE_COLOURS, (0.0, 1.0), "probability of an error below 1 px of total disparity"
    return [*panels, _map("confidence", confidence, scale)]


def _panel(uri: str, caption: str) -> Panel:
    return {"image": uri, "caption": caption}


def _map(caption: str, values: np.ndarray, scale: Scale, confidence: np.ndarray | None = None) -> Panel:
    colours, limits, label = scale
    image = map_image(values, colours, limits, confidence)
    return _panel(drawing_uri(image), caption) | {"bar": colour_bar_uri(colours, limits, label)}

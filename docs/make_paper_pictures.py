"""Draw docs/overview.jpg and docs/removal.jpg, of the paper's scene: `docs/make_paper_pictures.py DATASET`.

DATASET is what `simgen generate paper -o DATASET --set products.radiance=none` makes.
"""

import sys
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

import pcii
from pcii.figures import (
    DEPTH_COLOURS,
    filled_means,
    map_image,
    smoothed,
    smoothing_for,
    to_srgb8,
    white_level,
)
from pcii.metrics import TrueFocus
from pcii.types import colour_index

DOCS = Path(__file__).parent
PART = np.s_[394:640, 300:720]
"""Ball and bird, in pixels of the virtual centre."""
MIDDLE_PX = 540
"""Side of the part of a view that is shown."""
NEAR_MM, FAR_MM = 515.0, 655.0
WIDE_IN, GAP_IN, TITLE_IN, EDGE_IN = 2.85, 0.12, 0.36, 0.14
GROUND, INK, FAINT = "#0d1016", "#eceff4", "#9aa4b2"
OF_PHOTONS = np.array([[1.0, 0.45, 0.4], [0.5, 0.92, 0.55], [0.5, 0.66, 1.0]])
"""Colours in which photons of red, green and blue pixels are drawn."""
WINDOW = np.s_[330:700, 180:850]
"""What the picture of the steps shows."""


def draw_steps(data: pcii.Dataset, truth: pcii.Truth) -> None:
    """Each of the three steps at both depths, from the sections to the masks."""
    z_mm = data.analysis["z_mm"]
    focus = pcii.segment(data.counts, z_mm, method="three-step")
    true_masks = TrueFocus(focus.sections.planes, truth).by_object
    steps = focus.steps
    estimate = focus.sections.estimate
    white = white_level(estimate[0])
    spread = np.quantile(steps["variance"], 0.999)
    bits = steps["entropy"][steps["entropy"] > 0]
    shown = [
        ("section", lambda p: to_srgb8(estimate[p], white), {}),
        ("mean of non-zero samples", lambda p: steps["mean"][p], {"cmap": "magma"}),
        ("variance", lambda p: steps["variance"][p], {"cmap": "magma", "vmin": 0, "vmax": spread}),
        ("threshold T", lambda p: steps["threshold"][p], {"cmap": "magma", "vmin": 0, "vmax": spread}),
        ("1: variance at most T", lambda p: steps["kept"][p], {"cmap": "gray"}),
        ("Roberts magnitude", lambda p: steps["edges"][p], {"cmap": "gray", "vmin": 0, "vmax": 3}),
        ("2: bright, cut into regions", lambda p: _mixed(steps["regions"][p] * steps["bright"][p]), {}),
        ("entropy, bits", lambda p: steps["entropy"][p], {"vmin": bits.min(), "vmax": bits.max()}),
        ("3: lowest entropy here", lambda p: steps["winner"][p] == p, {"cmap": "gray"}),
        ("in focus", lambda p: focus.in_focus[p], {"cmap": "gray"}),
        ("truth", lambda p: true_masks[p], {"cmap": "gray"}),
    ]
    figure, axes = plt.subplots(len(shown), 2, figsize=(5.2, 1.48 * len(shown)), layout="constrained")
    for row, (title, image, style) in zip(axes, shown, strict=True):
        for plane, axis in enumerate(row):
            axis.imshow(image(plane)[WINDOW], interpolation="nearest", **style)
            axis.set(xticks=[], yticks=[])
            axis.set_title(f"{title}, {z_mm[plane]:g} mm", fontsize=7, pad=2)
    figure.savefig(DOCS / "removal.jpg", dpi=110, pil_kwargs={"quality": 70})


def _mixed(numbers: np.ndarray) -> np.ndarray:
    """A colour for each number, black for 0."""
    colours = np.random.default_rng(1).uniform(0.25, 1, size=(int(numbers.max()) + 1, 3))
    colours[0] = 0
    return colours[numbers]


def draw_overview(data: pcii.Dataset, truth: pcii.Truth) -> None:
    """From the photons of a view to depth."""
    counts, z_mm, z_range_mm = data.counts, data.analysis["z_mm"], data.analysis["z_range_mm"]
    focus = pcii.segment(counts, z_mm)
    depth = pcii.estimate_depth(counts, z_range_mm)
    score = pcii.score(focus, depth, truth)
    iou = {row["z_mm"]: row["iou"] for row in score.planes if row["truth"] == "object"}
    shown = light(focus.sections)
    white = white_level(shown[0][PART])

    plt.rcParams.update({"font.family": "DejaVu Sans", "text.color": INK, "axes.titlecolor": INK})
    high = WIDE_IN * shown[0][PART].shape[0] / shown[0][PART].shape[1]
    square = 2 * high + TITLE_IN
    size = 2 * EDGE_IN + square + 3 * (WIDE_IN + GAP_IN), square + TITLE_IN + EDGE_IN
    figure = plt.figure(figsize=size, facecolor=GROUND)

    def place(row: int, col: int) -> Axes:
        left = EDGE_IN + square + GAP_IN + (col - 1) * (WIDE_IN + GAP_IN) if col else EDGE_IN
        width, height = (WIDE_IN, high) if col else (square, square)
        bottom = EDGE_IN + (1 - row) * (high + TITLE_IN) if col else EDGE_IN
        return figure.add_axes((left / size[0], bottom / size[1], width / size[0], height / size[1]))

    photons(place(0, 0), counts)
    for row, z in enumerate(z_mm):
        section = to_srgb8(shown[row], white)
        panel(place(row, 1), section[PART], f"Section at {z:g} mm")
        in_focus = np.where(focus.in_focus[row][..., None], section, 0)
        panel(place(row, 2), in_focus[PART], f"In focus at {z:g} mm: IoU {iou[z]:.2f}")
    depth_picture = map_image(depth.z_mm, DEPTH_COLOURS, (NEAR_MM, FAR_MM), depth.confidence)
    panel(place(0, 3), depth_picture[PART], f"Depth: median error {score.depth['median_mm']:.1f} mm")
    true = map_image(np.where(truth.object_id > 0, truth.z_mm, np.nan), DEPTH_COLOURS, (NEAR_MM, FAR_MM))
    last = place(1, 3)
    panel(last, true[PART], "True depth")
    for number in truth.names:
        of_object = truth.object_id == number
        z = truth.z_mm[of_object]
        middle = np.nonzero(of_object[PART])[1].mean()
        last.text(
            middle, 240, f"{z.min():.0f}–{z.max():.0f} mm", color=FAINT, fontsize=9, ha="center", va="bottom"
        )
    figure.savefig(DOCS / "overview.jpg", dpi=130, pil_kwargs={"quality": 86})


def light(sections: pcii.Sections) -> np.ndarray:
    """Photons per sample and colour, (Z, H, W, 3), smoothed as in a report."""
    sigma = smoothing_for([counts[PART] for counts in sections.counts])
    print(f"sections are smoothed by {sigma:g} pixels: README says so")
    planes = zip(sections.counts, sections.coverage, strict=True)
    return np.stack([filled_means(*smoothed(sums, samples, sigma)) for sums, samples in planes])


def photons(axis: Axes, counts: pcii.PhotonCounts) -> None:
    """The middle of one of the middle views, a dot for each pixel that counted, in the pixel's colour."""
    view = counts.view(counts.grid.rows // 2, counts.grid.cols // 2)
    i, j = np.nonzero(view)
    height, width = view.shape
    colours = OF_PHOTONS[colour_index(height, width, counts.cfa)[i, j]]
    axis.scatter(j, i, s=5, c=colours, linewidths=0)
    (top, bottom), (left, right) = (((n - MIDDLE_PX) / 2, (n + MIDDLE_PX) / 2) for n in (height, width))
    axis.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    title(axis, f"One of {counts.grid.view_count} views: a dot is a photon")


def panel(axis: Axes, image: np.ndarray, text: str) -> None:
    """An image with a title above."""
    axis.imshow(image, interpolation="lanczos")
    title(axis, text)


def title(axis: Axes, text: str) -> None:
    """A title above the left edge, and a thin frame."""
    axis.set(xticks=[], yticks=[], facecolor="black")
    axis.set_title(text, fontsize=11, loc="left", pad=5)
    for side in axis.spines.values():
        side.set(color=FAINT, linewidth=0.5)


if __name__ == "__main__":
    dataset = pcii.open_dataset(sys.argv[1])
    if dataset.truth is None:
        raise SystemExit(f"{sys.argv[1]}: has no truth")
    draw_steps(dataset, dataset.truth)
    draw_overview(dataset, dataset.truth)

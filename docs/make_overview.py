"""Draw docs/overview.jpg, from photons to depth on the paper's scene: `python docs/make_overview.py DATASET`.

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
from pcii.figures.pictures import depth_image, filled_means, smoothed, smoothing_for, to_srgb8, white_level
from pcii.types.bayer import colour_index

PART = np.s_[394:640, 300:720]
"""Ball and bird, in pixels of the virtual centre."""
MIDDLE_PX = 540
"""Side of the part of a view that is shown."""
NEAR_MM, FAR_MM = 515.0, 655.0
WIDE_IN, GAP_IN, TITLE_IN, EDGE_IN = 2.85, 0.12, 0.36, 0.14
GROUND, INK, FAINT = "#0d1016", "#eceff4", "#9aa4b2"
OF_PHOTONS = np.array([[1.0, 0.45, 0.4], [0.5, 0.92, 0.55], [0.5, 0.66, 1.0]])
"""Colours in which photons of red, green and blue pixels are drawn."""


def main(dataset: Path) -> None:
    """Write the picture beside this script."""
    data = pcii.open_dataset(dataset)
    truth, counts, z_mm = data.truth, data.counts, data.analysis["z_mm"]
    if truth is None:
        raise SystemExit(f"{dataset}: has no truth")
    focus = pcii.segment(counts, z_mm)
    depth = pcii.estimate_depth(counts, data.analysis["z_range_mm"])
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
        kept = np.where(focus.in_focus[row][..., None], section, 0)
        panel(place(row, 2), kept[PART], f"In focus at {z:g} mm: IoU {iou[z]:.2f}")
    found = depth_image(depth.z_mm, NEAR_MM, FAR_MM, depth.confidence)
    panel(place(0, 3), found[PART], f"Depth: median error {score.depth['median_mm']:.1f} mm")
    true = depth_image(np.where(truth.object_id > 0, truth.z_mm, np.nan), NEAR_MM, FAR_MM)
    last = place(1, 3)
    panel(last, true[PART], "True depth")
    for number in truth.names:
        of_object = truth.object_id == number
        z = truth.z_mm[of_object]
        middle = np.nonzero(of_object[PART])[1].mean()
        last.text(
            middle, 240, f"{z.min():.0f}–{z.max():.0f} mm", color=FAINT, fontsize=9, ha="center", va="bottom"
        )
    figure.savefig(Path(__file__).with_name("overview.jpg"), dpi=130, pil_kwargs={"quality": 86})


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
    main(Path(sys.argv[1]))

"""Draw docs/removal.jpg, each step on the paper's scene: `python docs/make_removal_picture.py DATASET`.

DATASET is what `simgen generate paper -o DATASET` makes.
"""

import sys
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot as plt

import pcii
from pcii.figures.pictures import to_srgb8, white_level
from pcii.metrics.true_masks import TrueFocus

WINDOW = np.s_[330:700, 180:850]


def main(dataset: Path) -> None:
    """Write the picture beside this script."""
    data = pcii.open_dataset(dataset)
    if data.truth is None:
        raise SystemExit(f"{dataset}: has no truth")
    z_mm = data.analysis["z_mm"]
    focus = pcii.segment(data.counts, z_mm, method="three-step")
    truth = TrueFocus(focus.sections.planes, data.truth).by_object
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
        ("truth", lambda p: truth[p], {"cmap": "gray"}),
    ]
    figure, axes = plt.subplots(len(shown), 2, figsize=(5.2, 1.48 * len(shown)), layout="constrained")
    for row, (title, image, style) in zip(axes, shown, strict=True):
        for plane, axis in enumerate(row):
            axis.imshow(image(plane)[WINDOW], interpolation="nearest", **style)
            axis.set(xticks=[], yticks=[])
            axis.set_title(f"{title}, {z_mm[plane]:g} mm", fontsize=7, pad=2)
    file = Path(__file__).with_name("removal.jpg")
    figure.savefig(file, dpi=110, pil_kwargs={"quality": 70})


def _mixed(numbers: np.ndarray) -> np.ndarray:
    """A colour for each number, black for 0."""
    colours = np.random.default_rng(1).uniform(0.25, 1, size=(int(numbers.max()) + 1, 3))
    colours[0] = 0
    return colours[numbers]


if __name__ == "__main__":
    main(Path(sys.argv[1]))

"""Radiance images: time against the error of pixels, and of what eyes see of it, to a long rendering."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.figures import curve, frame
from benchmarks.machine import has
from benchmarks.results import Measured, Row, Size, Study, Value, mean_of
from benchmarks.scenes import capture_of, film
from benchmarks.timing import median_of, side_by_side
from simgen.photons import Capture
from simgen.renderer import backend, render_view
from simgen.spec import load_recipe

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCENES = {"matt": "paper", "glossy": "glossy", "glass": "glass"}
VIEW = ["grid.rows=1", "grid.cols=1"]
IMAGES = "Time and error of one view"
LIT_SHARE = 0.01
"""Pixels above this share of the 99th percentile of brightness are lit: with 0.001 or 0.03 nearly as many."""


SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {"side_px": 128, "samples": (1, 4, 16, 64), "repeats": 6, "reference": 1024},
    "full": {"side_px": 256, "samples": (1, 4, 16, 64, 256), "repeats": 12, "reference": 16384},
}


def measure(side_px: int, samples: Sequence[int], repeats: int, reference: int) -> Measured:
    """So many samples per pixel on every scene; the truth has `reference` samples."""
    rows: list[Row] = []
    for scene, recipe in SCENES.items():
        capture = capture_of(load_recipe(recipe, [*VIEW, *film(side_px)])[0])
        truth = rendered(capture, reference, seed=10_000).astype(np.float64)
        images: dict[int, list[np.ndarray]] = {number: [] for number in samples}
        works = {
            number: lambda seed, of=views, n=number, capture=capture: of.append(rendered(capture, n, seed))
            for number, views in images.items()
        }
        for number, seconds in side_by_side(works, repeats).items():
            values = {"time_ms": median_of(seconds, 1e3)} | errors(np.array(images[number][1:]), truth)
            way = backend.choose().kind
            rows.append(Row(IMAGES, way, {"scene": scene, "samples": number}, values))
    return Measured(rows, seeds=list(range(1, repeats + 1)))


def rendered(capture: Capture, samples: int, seed: int) -> np.ndarray:
    """The view (H, W, 3), rendered with this number of samples per pixel."""
    return render_view(capture.render_scene, capture.grid, 0, 0, samples_per_pixel=samples, seed=seed)


def errors(images: np.ndarray, truth: np.ndarray) -> dict[str, Value]:
    """Of images (R, H, W, 3) to the truth: RMS error and bias of the lit pixels, and mean FLIP of all.

    Both are relative to the mean light of the lit pixels; relative to that of a film which is mostly black
    they would only tell how much of it is. Bias is what the mean over repeats is off by beyond its own noise.
    """
    brightness = truth.mean(axis=-1)
    lit = brightness > LIT_SHARE * np.quantile(brightness, 0.99)
    light, repeats = truth[lit].mean(), len(images)
    rmse = [100 / light * float(np.sqrt(((image - truth)[lit] ** 2).mean())) for image in images]
    noise = images[:, lit].var(axis=0, ddof=1, dtype=np.float64).mean() / repeats
    off = ((images[:, lit].mean(axis=0, dtype=np.float64) - truth[lit]) ** 2).mean() - noise
    values = {
        "rmse_percent": mean_of(rmse),
        "bias_percent": Value(100 / float(light) * float(np.sqrt(max(off, 0.0)))),
    }
    if has("flip-evaluator"):
        values["flip"] = mean_of([flip(image, truth) for image in images])
    return values


def flip(image: np.ndarray, truth: np.ndarray) -> float:
    """Mean HDR FLIP of a linear image: 0 is no visible difference, 1 the largest."""
    import flip_evaluator  # pyright: ignore[reportMissingImports]

    scale = np.quantile(truth, 0.99)
    one, other = (np.ascontiguousarray(np.maximum(each / scale, 0), np.float32) for each in (truth, image))
    return float(flip_evaluator.evaluate(one, other, "HDR", applyMagma=False)[1])


def draw(figure: "Figure", measured: Measured) -> None:
    """Both errors against time, a line for each scene."""
    quantities = [name for name in ("rmse_percent", "flip") if name in measured.rows[0].values]
    panels = figure.subplots(1, len(quantities), squeeze=False)
    for axes, quantity in zip(panels[0], quantities, strict=True):
        for number, scene in enumerate(SCENES):
            curve(axes, measured.of(IMAGES, scene=scene), "time_ms", quantity, scene, number)
        frame(axes, "time_ms", quantity)


def reading(measured: Measured) -> str:
    """How to read it: the errors of the fewest and of the most samples in the matt scene."""
    few, *_, many = measured.of(IMAGES, scene="matt")
    least, most = (row.values["rmse_percent"].value for row in (many, few))
    return (
        "What does an image without photon noise cost? Errors fall with the samples and so with the time: in"
        f" the matt scene from {most:.0f} % of the mean light with {few.parameters['samples']} sample to"
        f" {least:.1f} % with {many.parameters['samples']}, of the pixels that are lit."
    )


STUDY = Study("radiance", "Radiance images", SIZES, measure, draw, reading)

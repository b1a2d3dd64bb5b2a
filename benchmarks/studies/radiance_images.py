"""Radiance images: time against the error of pixels and of what eyes see of it, to a long rendering.

Samples per pixel, lengths of paths, the renderer's modes, and a denoiser. The scalar mode runs in a
process of its own beside the others, since a process has one backend.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.figures import curve, frame
from benchmarks.machine import has
from benchmarks.results import Measured, Ratio, Row, Size, Study, Value, mean_of
from benchmarks.scenes import capture_of, film
from benchmarks.timing import median_of, timed
from simgen.photons.capture import Capture
from simgen.renderer import backend
from simgen.renderer.radiance import render_view
from simgen.spec.recipe import load_recipe

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCENES = {"matt": "paper", "glossy": "glossy", "glass": "glass"}
VIEW = ["grid.rows=1", "grid.cols=1"]
IMAGES = "Time and error of one view"
DEPTHS = "Segments of a path: what shorter paths miss"
DENOISED = "and OIDN"
CAMERA = "Nikon 5100 (NPL)"
Images = np.ndarray
"""Repeats of one view, (R, H, W, 3)."""
LIT_SHARE = 0.01
"""Pixels above this share of the 99th percentile of brightness are lit: with 0.001 or 0.03 nearly as many."""


SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {"side_px": 128, "samples": (1, 4, 16, 64), "repeats": 6, "reference": 1024},
    "full": {"side_px": 256, "samples": (1, 4, 16, 64, 256), "repeats": 12, "reference": 16384},
}


def measure(
    side_px: int,
    samples: Sequence[int],
    repeats: int,
    reference: int,
    scenes: Mapping[str, str] = SCENES,
    depths: Sequence[int] = (2, 3, 5, 8, 16),
) -> Measured:
    """All ways on every scene, and lengths of paths through glass; the truth has `reference` samples."""
    rows: list[Row] = []
    for scene, recipe in scenes.items():
        capture = capture_of(load_recipe(recipe, [*VIEW, *film(side_px)])[0])
        truth = rendered(capture, reference, 1, seed=10_000)[1][0].astype(np.float64)
        kind = backend.choose().kind
        for number in samples:
            seconds, images = rendered(capture, number, repeats)
            rows.append(_row(scene, kind, number, seconds, images, truth))
            if has("mitsuba-oidn"):
                rows.append(_denoised_row(scene, kind, number, seconds, images, truth))
        if kind != "scalar":
            for number, (seconds, images) in _by_scalar_mode(recipe, side_px, samples[:3], repeats).items():
                rows.append(_row(scene, "scalar", number, seconds, images, truth))
        del capture  # before another variant is set
    ratios = _ratios(rows)
    rows += _depth_rows(side_px, samples[-1], repeats, depths)
    rows += _spectral_rows(side_px, samples[:3], repeats)
    return Measured(rows, ratios, list(range(1, repeats + 1)))


def rendered(capture: Capture, samples: int, repeats: int, seed: int = 1) -> tuple[list[float], Images]:
    """Seconds of each repeat and the images, with seeds from `seed` on; after one that warms up."""
    images: list[np.ndarray] = []

    def work(number: int) -> None:
        image = render_view(
            capture.render_scene, capture.grid, 0, 0, samples_per_pixel=samples, seed=seed + number
        )
        images.append(image)

    seconds, _ = timed(work, repeats)
    return seconds, np.array(images[1:])


def _by_scalar_mode(
    recipe: str, side_px: int, samples: Sequence[int], repeats: int
) -> dict[int, tuple[list[float], Images]]:
    """Seconds and images of each number of samples, by a process of its own."""
    call = f"scalar_images({recipe!r}, {side_px}, {tuple(samples)}, {repeats})"
    code = f"from benchmarks.studies.radiance_images import scalar_images; {call}"
    environment = os.environ | {"SIMGEN_BACKEND": "scalar"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, env=environment)
    head, _, body = done.stdout.partition(b"\n")
    shape = (len(samples), repeats, side_px, side_px, 3)
    images = np.frombuffer(body, np.float32).reshape(shape)
    return dict(zip(samples, zip(json.loads(head), images, strict=True), strict=True))


def scalar_images(recipe: str, side_px: int, samples: Sequence[int], repeats: int) -> None:
    """Write seconds and then images of this process's backend on standard output."""
    capture = capture_of(load_recipe(recipe, [*VIEW, *film(side_px)])[0])
    found = [rendered(capture, number, repeats) for number in samples]
    head = json.dumps([seconds for seconds, _ in found]).encode()
    body = np.array([images for _, images in found], np.float32).tobytes()
    sys.stdout.buffer.write(head + b"\n" + body)


def denoise(image: np.ndarray) -> np.ndarray:
    """What Open Image Denoise makes of a linear image, without albedo and normals."""
    import mitsuba_oidn  # pyright: ignore[reportMissingImports]

    return np.array(mitsuba_oidn.denoise(np.ascontiguousarray(image, np.float32), hdr=True))


def _denoised_row(
    scene: str, kind: str, samples: int, seconds: Sequence[float], images: Images, truth: np.ndarray
) -> Row:
    found = images.copy()

    def work(number: int) -> None:
        found[max(number - 1, 0)] = denoise(images[max(number - 1, 0)])

    taken, _ = timed(work, len(images))
    total = [one + other for one, other in zip(seconds, taken, strict=True)]
    return _row(scene, f"{kind} {DENOISED}", samples, total, found, truth)


def _row(
    scene: str, way: str, samples: int, seconds: Sequence[float], images: Images, truth: np.ndarray
) -> Row:
    values = {"time_ms": median_of(seconds, 1e3)} | errors(images, truth)
    return Row(IMAGES, way, {"scene": scene, "samples": samples}, values)


def errors(images: Images, truth: np.ndarray) -> dict[str, Value]:
    """Of images to the truth: root mean square error and bias of the lit pixels, and mean FLIP of all.

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


def _depth_rows(side_px: int, samples: int, repeats: int, depths: Sequence[int]) -> list[Row]:
    """Time of paths of so many segments through glass, and what share of all light they find."""
    found: dict[int, tuple[list[float], Images]] = {}
    for depth in depths:
        recipe, _ = load_recipe("glass", [*VIEW, *film(side_px), f"render.max_depth={depth}"])
        found[depth] = rendered(capture_of(recipe), samples, repeats)
    light = found[max(depths)][1].mean()
    return [
        Row(
            DEPTHS,
            "glass",
            {"segments": depth, "samples": samples},
            {
                "time_ms": median_of(seconds, 1e3),
                "light_percent": mean_of([100 * float(image.mean() / light) for image in images]),
            },
        )
        for depth, (seconds, images) in found.items()
    ]


def _spectral_rows(side_px: int, samples: Sequence[int], repeats: int) -> list[Row]:
    """Spectral mode of the matt scene, in a camera's raw colours and so to a truth of its own."""
    if backend.choose().kind == "scalar":  # there it takes minutes
        return []
    capture = capture_of(load_recipe("paper", [*VIEW, *film(side_px), f"sensor.camera={CAMERA}"])[0])
    truth = rendered(capture, 64 * max(samples), 1, seed=10_000)[1][0].astype(np.float64)
    rows: list[Row] = []
    for number in samples:
        seconds, images = rendered(capture, number, repeats)
        rows.append(_row("matt", f"{backend.choose().kind}, spectral", number, seconds, images, truth))
    return rows


def _ratios(rows: Sequence[Row]) -> list[Ratio]:
    """By how much the denoiser lessens the error of the same images of the matt scene."""
    if not has("mitsuba-oidn"):
        return []
    kind, one = backend.choose().kind, _one_of(rows)
    ratio = one(kind, 1, "rmse_percent") / one(f"{kind} {DENOISED}", 1, "rmse_percent")
    return [Ratio("error of 1 sample without against with OIDN", Value(ratio))]


def _one_of(rows: Sequence[Row]) -> Callable[[str, int, str], float]:
    measured = Measured(rows)

    def value(way: str, samples: int, quantity: str) -> float:
        return measured.one(IMAGES, way, scene="matt", samples=samples).values[quantity].value

    return value


def draw(figure: "Figure", measured: Measured) -> None:
    """Both errors against time, a column for each scene."""
    quantities = [name for name in ("rmse_percent", "flip") if name in measured.of(IMAGES)[0].values]
    scenes = dict.fromkeys(row.parameters["scene"] for row in measured.of(IMAGES))
    panels = figure.subplots(len(quantities), len(scenes), squeeze=False)
    for (line, quantity), (column, scene) in product(enumerate(quantities), enumerate(scenes)):
        axes: Any = panels[line, column]
        rows = measured.of(IMAGES, scene=scene)
        for number, way in enumerate(dict.fromkeys(row.name for row in rows)):
            curve(axes, [row for row in rows if row.name == way], "time_ms", quantity, way, number)
        frame(axes, "time_ms", quantity, str(scene) if line == 0 else "")


def reading(measured: Measured) -> str:
    """How to read it: the gain of the denoiser at one sample, and its bias."""
    kind = next(row.name for row in measured.of(IMAGES))
    one = _one_of(measured.rows)
    samples = max(int(row.parameters["samples"]) for row in measured.of(IMAGES, scene="matt"))
    text = (
        "What does an image without photon noise cost? Errors fall with the samples and so with the time: in"
        f" the matt scene from {one(kind, 1, 'rmse_percent'):.0f} % of the mean light with 1 sample to"
        f" {one(kind, samples, 'rmse_percent'):.1f} % with {samples}, of the pixels that are lit."
    )
    way = f"{kind} {DENOISED}"
    if not any(row.name == way for row in measured.of(IMAGES)):
        return text + " The denoiser was not installed."
    return text + (
        f" OIDN brings 1 sample to {one(way, 1, 'rmse_percent'):.0f} %, but"
        f" {one(way, 1, 'bias_percent'):.1f} % of the light is bias that no repeat averages out (with"
        f" {samples} samples {one(way, samples, 'bias_percent'):.1f} %): it is for pictures to look at,"
        " never for data that counts are drawn from."
    )


STUDY = Study("radiance", "Radiance images", SIZES, measure, draw, reading, width_in=11.0, height_in=6.5)

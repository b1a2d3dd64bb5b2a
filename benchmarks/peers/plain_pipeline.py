"""The paper's experiment in one plain script of Mitsuba, NumPy and SciPy: what one would write in a day.

`python -m benchmarks.peers.plain_pipeline --folder scenes/two_objects --out X` renders the
views, draws counts, makes sections, masks and a depth map, scores them and writes a report; it prints seconds
by stage as JSON. No checks, no resume, no colours apart: the shortest way there.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter

FOCAL_MM, FIELD_MM, PLANES_MM, RANGE_MM, BUDGET = 50.0, 36.0448, (540.0, 620.0), (450.0, 750.0), 1000


def load_scene(mi, folder: Path):
    """The ball, the bird, the lamp and the backdrop of scenes/two_objects."""
    T = mi.ScalarTransform4f

    def picture(name):
        return {"type": "diffuse", "reflectance": {"type": "bitmap", "filename": str(folder / name)}}

    def grey(value):
        return {"type": "diffuse", "reflectance": {"type": "rgb", "value": value}}

    lamp = T().look_at(origin=[-250, -450, 150], target=[0, 0, 590], up=[0, -1, 0]) @ T().scale([200, 200, 1])
    turned = T().translate([-45, 0, 560.7]) @ T().rotate([0, 0, 1], -90) @ T().rotate([1, 0, 0], -90)
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 3},
            "ball": {"type": "sphere", "radius": 30, "to_world": turned, "bsdf": picture("ball.png")},
            "bird": {
                "type": "ply",
                "filename": str(folder / "bird.ply"),
                "to_world": T().translate([46.5, -2, 637.5]) @ T().rotate([0, 1, 0], 35),
                "bsdf": {"type": "twosided", "bsdf": picture("bird.png")},
            },
            "wall": {
                "type": "rectangle",
                "to_world": T().translate([0, 0, 3000]) @ T().rotate([0, 1, 0], 180) @ T().scale(2400),
                "bsdf": {"type": "twosided", "bsdf": grey(0.013)},
            },
            "lamp": {
                "type": "rectangle",
                "to_world": lamp,
                "bsdf": grey(0.0),
                "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 2000.0}},
            },
            "around": {"type": "constant", "radiance": {"type": "rgb", "value": 30.0}},
        }
    )


def camera(mi, x_mm: float, y_mm: float, side_px: int):
    """A pinhole camera that looks along +Z with Y down."""
    return mi.load_dict(
        {
            "type": "perspective",
            "fov": 2 * np.degrees(np.arctan(FIELD_MM / 2 / FOCAL_MM)),
            "to_world": mi.ScalarTransform4f().translate([x_mm, y_mm, 0])
            @ mi.ScalarTransform4f().scale([-1, -1, 1]),
            "film": {
                "type": "hdrfilm",
                "width": side_px,
                "height": side_px,
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
        }
    )


def bayer(image: np.ndarray) -> np.ndarray:
    """The GRBG mosaic of an image."""
    raw = image[..., 1].copy()
    raw[0::2, 1::2], raw[1::2, 0::2] = image[0::2, 1::2, 0], image[1::2, 0::2, 2]
    return raw


def shifted(view: np.ndarray, down: float, right: float) -> np.ndarray:
    """A view moved by whole pixels, zeros where nothing is."""
    r, c = int(np.floor(down + 0.5)), int(np.floor(right + 0.5))
    H, W = view.shape
    out = np.zeros_like(view)
    if abs(r) < H and abs(c) < W:
        out[max(r, 0) : H + min(r, 0), max(c, 0) : W + min(c, 0)] = view[
            max(-r, 0) : H - max(r, 0), max(-c, 0) : W - max(c, 0)
        ]
    return out


def stack(counts: np.ndarray, z_mm: float, pitch_px: float) -> tuple[np.ndarray, np.ndarray]:
    """Sum and sum of squares of all views, moved to focus at a depth; `pitch_px` is the disparity at 1 mm."""
    rows, cols = counts.shape[:2]
    total, squares = np.zeros(counts.shape[2:]), np.zeros(counts.shape[2:])
    for k, l in np.ndindex(rows, cols):
        view = shifted(
            counts[k, l], *((n - (size - 1) / 2) * pitch_px / z_mm for n, size in ((k, rows), (l, cols)))
        )
        total += view
        squares += view**2
    return total, squares


def run(folder: Path, rows: int, side_px: int, samples: int, out: Path) -> dict[str, float]:
    """All stages; seconds of each."""
    seconds: dict[str, float] = {}
    last = time.perf_counter()

    def done(stage: str) -> None:
        nonlocal last
        now = time.perf_counter()
        seconds[stage], last = now - last, now

    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb", "scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)  # warnings go to standard output
    out.mkdir(parents=True, exist_ok=True)
    rng, pitch_mm = np.random.default_rng(2017), 45 / (rows - 1)
    pitch_px = pitch_mm * FOCAL_MM / (FIELD_MM / side_px)
    scene = load_scene(mi, folder)
    done("load")
    radiance = np.empty((rows, rows, side_px, side_px), dtype=np.float32)
    for k, l in np.ndindex(rows, rows):
        x_mm, y_mm = ((n - (rows - 1) / 2) * pitch_mm for n in (l, k))
        sensor = camera(mi, x_mm, y_mm, side_px)
        radiance[k, l] = bayer(np.array(mi.render(scene, sensor=sensor, spp=samples, seed=1 + k * rows + l)))
    np.save(out / "radiance.npy", radiance)
    done("radiance")
    light = radiance.sum(axis=(2, 3), keepdims=True, dtype=np.float64)
    counts = rng.poisson(BUDGET * radiance / light).astype(np.float32)
    np.save(out / "counts.npy", counts)
    done("counts")
    integrator = mi.load_dict({"type": "aov", "aovs": "hit:position"})
    depth = np.array(mi.render(scene, sensor=camera(mi, 0, 0, side_px), integrator=integrator, spp=1))[
        ..., -1
    ]
    done("truth")
    sections = np.array([stack(counts, z, pitch_px)[0] for z in PLANES_MM])
    full_light = np.array([stack(radiance, z, pitch_px)[0] for z in PLANES_MM]) / rows**2
    done("sections")
    sigma = 4 * side_px / 1024
    smooth = np.array([gaussian_filter(section, sigma) for section in sections])
    masks = (smooth == smooth.max(axis=0)) & (smooth > smooth.max() / 4)
    done("removal")
    depths = 1 / np.linspace(1 / RANGE_MM[0], 1 / RANGE_MM[1], 64)
    best, cost = np.zeros((side_px, side_px)), np.full((side_px, side_px), np.inf)
    for z in depths:
        total, squares = (gaussian_filter(part, sigma) for part in stack(counts, z, pitch_px))
        spread = (squares / rows**2 - (total / rows**2) ** 2) / np.maximum(total / rows**2, 1e-9)
        best, cost = np.where(spread < cost, z, best), np.minimum(spread, cost)
    done("depth")
    true = [np.abs(depth - z) < 40 for z in PLANES_MM]
    ious = [float((m & t).sum() / max((m | t).sum(), 1)) for m, t in zip(masks, true, strict=True)]
    either = true[0] | true[1]
    error = float(np.median(np.abs(best - depth)[either])) if either.any() else None
    done("score")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 6))
    for axes, image in zip(figure.subplots(2, 3).flat, (*full_light, *masks, smooth[0], best), strict=True):
        axes.imshow(image)
    figure.savefig(out / "report.png")
    (out / "report.html").write_text(f"<img src=report.png><p>IoU {ious}, median error {error} mm</p>")
    done("report")
    return seconds


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--rows", type=int, default=10)
    parser.add_argument("--side-px", type=int, default=1024)
    parser.add_argument("--samples", type=int, default=8)
    parser.add_argument("--out", type=Path, required=True)
    print(json.dumps(run(**vars(parser.parse_args()))))

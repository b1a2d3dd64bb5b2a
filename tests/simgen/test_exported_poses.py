"""What the renderer saw is where the exported poses say, read by the formula of OpenGL's cameras alone."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from lit_scenes import EVENLY, ball

from pcii.exchange import export_dataset
from simgen.dataset import generate
from simgen.spec import Recipe

pytestmark = pytest.mark.renders
CENTRE_MM, RADIUS_MM, WALL_MM = (12.0, -21.0, 500.0), 30.0, 800.0
BALL = ball("ball", 12.0, 500.0, (0.8, 0.8, 0.8), RADIUS_MM, -21.0)
SCENE = {"title": "Up to the right", "lights": [EVENLY], "objects": [BALL], "backdrop": {"z_mm": WALL_MM}}
GRID = {"rows": 2, "cols": 3, "pitch_mm": [18.0, 12.0], "pixel_mm": 0.5, "height": 40, "width": 50}
SHEARED = {"shear_px": [3.0, -2.0]}
ERRORS = {"errors": {"position_sd_mm": [1.0, 1.0, 5.0], "rotation_sd_deg": [1.0, 1.0, 5.0]}}
PX_MM = 500.0 * 0.5 / 50
"""What a pixel sees of the ball."""


def points_mm(folder: Path, frame: dict[str, Any]) -> np.ndarray:
    """What the pixels of a picture see, (H, W, 3) with Y down and Z forward, by its depth and pose."""
    depth = np.load(folder / frame["depth_file_path"]).astype(np.float64)
    pose = np.array(frame["transform_matrix"])
    i, j = np.mgrid[: frame["h"], : frame["w"]] + 0.5
    x, y = (j - frame["cx"]) / frame["fl_x"], (frame["cy"] - i) / frame["fl_y"]
    ahead = depth[..., None] * np.stack([x, y, np.full(x.shape, -1.0)], axis=-1)
    return (ahead @ pose[:3, :3].T + 1000 * pose[:3, 3]) * [1, -1, -1]


@pytest.mark.parametrize("grid", [{}, SHEARED, ERRORS], ids=["plain", "sheared", "errors"])
def test_pixels_of_all_cameras_see_the_same_ball_and_wall(tmp_path: Path, grid: dict[str, Any]) -> None:
    (tmp_path / "ball").mkdir()
    (tmp_path / "ball" / "scene.toml").write_text(tomli_w.dumps(SCENE))
    products = {"view_truth": ["z_mm"], "counts": False, "radiance": "rgb"}
    values = {"scene": "ball", "grid": GRID | grid, "products": products, "render": {"samples_per_pixel": 1}}
    generate(Recipe.model_validate(values), tmp_path, tmp_path / "data")
    folder = export_dataset(tmp_path / "data", "nerfstudio", tmp_path / "posed")
    top = json.loads((folder / "transforms.json").read_text())
    for frame in top.pop("frames"):
        point = points_mm(folder, top | frame)
        on_ball = np.abs(np.linalg.norm(point - CENTRE_MM, axis=-1) - RADIUS_MM)
        on_wall = np.abs(point[..., 2] - WALL_MM)
        # A pose or a pixel that is wrong by 0.01 px is off by so much somewhere on the ball.
        assert np.minimum(on_ball, on_wall).max() < 0.01 * PX_MM
        assert 60 < (on_ball < 0.01 * PX_MM).sum() < 150  # pi 30^2 / 5^2 are 113

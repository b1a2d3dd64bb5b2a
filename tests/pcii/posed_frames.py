"""Files transforms.json with the frames of a grid of cameras, written from the format's description."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from pcii.exchange import TransformsFile, read_transforms

TOP = {"fl_x": 1000.0, "fl_y": 1000.0, "w": 640, "h": 480}
Frame = dict[str, Any]


def frames_of(
    rows: int,
    cols: int,
    pitch_mm: tuple[float, float] = (5.0, 4.0),
    turn: np.ndarray | None = None,
    place_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> list[Frame]:
    """Frames row by row from the top left: right is the first column of `turn`, down against its second."""
    turn = np.eye(3) if turn is None else turn
    frames = []
    for k, l in np.ndindex(rows, cols):
        pose = np.eye(4)
        pose[:3, :3] = turn
        pose[:3, 3] = turn @ np.array([l * pitch_mm[0], -k * pitch_mm[1], 0]) / 1000 + place_m
        frames.append({"file_path": f"images/{k}_{l}.png", "transform_matrix": pose.tolist()})
    return frames


def moved(frame: Frame, x_mm: float, y_mm: float, z_mm: float) -> None:
    """Move the camera of a frame in the world of the file."""
    for row, off in zip(frame["transform_matrix"], (x_mm, y_mm, z_mm), strict=False):
        row[3] += off / 1000


def turned(frame: Frame, turn: np.ndarray) -> None:
    """Turn the camera of a frame about its own place."""
    pose = np.array(frame["transform_matrix"])
    pose[:3, :3] = turn @ pose[:3, :3]
    frame["transform_matrix"] = pose.tolist()


def about_y(degrees: float) -> np.ndarray:
    """Rotation about the second axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def written(folder: Path, frames: list[Frame], **top: Any) -> Path:
    """The file; members of `top` that are None are left out."""
    members = {name: value for name, value in (TOP | top).items() if value is not None}
    path = folder / "transforms.json"
    path.write_text(json.dumps(members | {"frames": frames}))
    return path


def read(folder: Path, frames: list[Frame], **top: Any) -> TransformsFile:
    """What is read of such a file."""
    return read_transforms(written(folder, frames, **top))

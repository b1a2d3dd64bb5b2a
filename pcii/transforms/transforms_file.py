"""A transforms.json that was read and checked: poses, focal length, principal points, paths.

The format is that of nerfstudio (docs/quickstart/data_conventions.md of its repository) and of Instant NGP;
visionsim's photon cubes have one file of pictures for all frames, `file_path` at the top.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.plain_text import visible
from pcii.store.sealed_json import LARGEST_DOCUMENT_BYTES, parse_json, read_small
from pcii.transforms.parsed_members import Members, finite

TRANSFORMS = "transforms.json"
REMEDY = "expected a transforms.json as nerfstudio reads it"
DEPTH_UNIT = "depth_unit_scale_factor"
"""Member with the unit, in metres, of the numbers in files of depth; named as nerfstudio's option."""
DEPTH_UNIT_M = 1e-3
"""That unit where there is no such member; nerfstudio's default."""
MOST_POSES = 1 << 16
"""Frames of a file: a photon cube of visionsim has a pose for each of its frames, a thousand or more."""
MOST_PIXELS = 1 << 20
"""Pixels of a side; no sensor has a tenth of it."""
FARTHEST_M = 1e6
"""Of a camera from the origin of its world; doubles place it to 1e-7 mm there."""
MOST_PX = 0.1
"""What cameras may be off by: sections are means of views, and a tenth of a pixel blurs none visibly."""
MOST_SKEW = 1e-4
"""Of a rotation, from columns of unit length at right angles: at the edge of a picture of 2000 px a length
that is wrong by this share moves a point by 0.1 px; matrices of 6 decimals are 100 times closer."""
PINHOLES = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE")
"""Values of camera_model that, without distortion, are pinholes."""
DISTORTIONS = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")


@dataclass(frozen=True, eq=False)
class TransformsFile:
    """What the file says of its N frames, which are in the order of the file."""

    path: Path
    document: Mapping[str, Any]
    """All members at the top, of which only those below are checked."""
    poses: np.ndarray
    """Camera-to-world matrices (N, 4, 4), float64: axes of OpenGL, metres; rotations are exact ones."""
    centres_px: np.ndarray
    """Principal points (N, 2) as (x, y), the first pixel's centre at 0.5."""
    focal_px: float
    width: int
    height: int
    file_paths: tuple[str | None, ...]
    """Picture of each frame, inside the folder of the file; None for all where `stack_path` holds them."""
    depth_paths: tuple[str | None, ...]
    stack_path: str | None
    """The one file with the pictures of all frames, in their order."""

    @property
    def is_bitpacked(self) -> bool:
        """Whether the pictures are a photon cube of visionsim: eight binary pixels in a byte."""
        return self.document.get("bitpack") is True

    def frame_name(self, number: int) -> str:
        """What messages call a frame: the path of its picture or, without one, its place in the list."""
        return visible(self.file_paths[number] or f"frames.{number}")


def read_transforms(path: str | Path) -> TransformsFile:
    """Read a transforms.json of anybody; no picture is opened.

    Intrinsics of a frame win over those at the top; where `fl_x` is missing, `camera_angle_x` tells it.
    Raises `InputError`, naming file and member, for what is missing or wrong, pixels that are not square,
    lenses that distort, frames of different size or focal length, matrices that are no poses, and paths that
    are used twice or lead out of the folder.
    """
    file = Path(path)
    document = parse_json(read_small(file, LARGEST_DOCUMENT_BYTES, REMEDY), file, REMEDY)
    top = Members(file, "", document)
    listed = document.get("frames")
    if not isinstance(listed, list) or not listed:
        raise top.fault("frames", "expected a list with a frame for each picture")
    if len(listed) > MOST_POSES:
        raise top.fault("frames", f"has {len(listed)} frames, and at most {MOST_POSES} are read")
    stack_path = top.inner_path("file_path") if top.has("file_path") else None
    frames = []
    for number, values in enumerate(listed):
        if not isinstance(values, dict):
            raise top.fault(f"frames.{number}", "expected an object with file_path and transform_matrix")
        frames.append(Members(file, f"frames.{number}.", values))
    _check_model(top)
    lenses = [_lens(top, frame) for frame in frames]
    width, height, focal_px, _ = lenses[0]
    for frame, lens in zip(frames, lenses, strict=True):
        _check_alike(frame, lens, lenses[0])
    paths = [None if stack_path is not None else frame.inner_path("file_path") for frame in frames]
    depths = [
        frame.inner_path("depth_file_path") if frame.has("depth_file_path") else None for frame in frames
    ]
    for name, found in (("file_path", paths), ("depth_file_path", depths)):
        _check_different(frames, name, found)
    return TransformsFile(
        path=file,
        document=document,
        poses=np.stack([_pose(frame) for frame in frames]),
        centres_px=np.array([centre for *_, centre in lenses]),
        focal_px=focal_px,
        width=width,
        height=height,
        file_paths=tuple(paths),
        depth_paths=tuple(depths),
        stack_path=stack_path,
    )


def _check_model(top: Members) -> None:
    model = top.values.get("camera_model")
    if model is not None and model not in PINHOLES:
        raise top.fault(
            "camera_model",
            f"expected one of {', '.join(PINHOLES)}; pictures of other lenses are undistorted first",
        )


_Lens = tuple[int, int, float, tuple[float, float]]
"""Width, height, focal length in px, principal point (x, y) in px."""


def _lens(top: Members, frame: Members) -> _Lens:
    """Intrinsics of a frame."""

    def of(name: str) -> Members:
        return frame if frame.has(name) else top

    for name in DISTORTIONS:
        if of(name).has(name) and of(name).number(name) != 0:
            raise of(name).fault(name, "the lens distorts; undistort the pictures first")
    more = of("distortion_params").values.get("distortion_params")
    if more is not None and (not isinstance(more, list) or any(finite(value) != 0 for value in more)):
        raise of("distortion_params").fault(
            "distortion_params", "the lens distorts; undistort the pictures first"
        )
    width, height = (of(name).whole(name, MOST_PIXELS) for name in ("w", "h"))
    across, down = (_focal_px(of, axis, size) for axis, size in (("x", width), ("y", height)))
    if across is None:
        raise top.fault("fl_x", "missing; the focal length in pixels, or camera_angle_x")
    if down is not None and abs(across - down) * max(width, height) / 2 > MOST_PX * across:
        raise of("fl_y").fault(
            "fl_y", f"is {down:g} where fl_x is {across:g}; pixels that are not square are resampled first"
        )
    x, y = (
        of(name).number(name) if of(name).has(name) else size / 2
        for name, size in (("cx", width), ("cy", height))
    )
    return width, height, across, (x, y)


def _focal_px(of: Any, axis: str, size: int) -> float | None:
    """Focal length in px, told as such or as the whole angle of view in radians."""
    if of(f"fl_{axis}").has(f"fl_{axis}"):
        return of(f"fl_{axis}").above_zero(f"fl_{axis}")
    angle = f"camera_angle_{axis}"
    if not of(angle).has(angle):
        return None
    radians = of(angle).above_zero(angle)
    if radians >= math.pi:
        raise of(angle).fault(angle, f"expected an angle in radians below pi, got {radians:g}")
    return size / 2 / math.tan(radians / 2)


def _check_alike(frame: Members, lens: _Lens, first: _Lens) -> None:
    width, height, focal_px, _ = lens
    if (width, height) != first[:2]:
        raise frame.fault(
            "w", f"{height} x {width} px, where the first frame has {first[1]} x {first[0]}, rows x columns"
        )
    if abs(focal_px - first[2]) * max(width, height) / 2 > MOST_PX * first[2]:
        raise frame.fault(
            "fl_x", f"{focal_px:g} px, where the first frame has {first[2]:g}; cameras of a grid are alike"
        )


def _check_different(frames: list[Members], name: str, paths: list[str | None]) -> None:
    seen: dict[str, Members] = {}
    for frame, path in zip(frames, paths, strict=True):
        if path is None:
            continue
        if path in seen:
            raise frame.fault(name, f"{path!r} is that of {seen[path].place.rstrip('.')} too")
        seen[path] = frame


def _pose(frame: Members) -> np.ndarray:
    """The checked matrix (4, 4) of a frame, its rotation the nearest exact one."""
    name = "transform_matrix"
    rows = frame.values.get(name)
    if not (isinstance(rows, list) and len(rows) == 4 and all(isinstance(row, list) for row in rows)):
        raise frame.fault(name, "expected four rows of four numbers")
    numbers = [[finite(value) for value in row] for row in rows]
    if any(len(row) != 4 or None in row for row in numbers):
        raise frame.fault(name, "expected four rows of four numbers")
    pose = np.array(numbers, np.float64)
    if pose[3].tolist() != [0, 0, 0, 1]:
        raise frame.fault(name, "the last row of a pose is 0 0 0 1")
    if np.abs(pose[:3, 3]).max() > FARTHEST_M:
        raise frame.fault(name, f"a place in metres is at most {FARTHEST_M:g} from the origin")
    pose[:3, :3] = _rotation(frame, name, pose[:3, :3])
    return pose


def _rotation(frame: Members, name: str, turn: np.ndarray) -> np.ndarray:
    left, lengths, right = (
        np.linalg.svd(turn) if np.abs(turn).max() < FARTHEST_M else (turn, np.zeros(3), turn)
    )
    scale = float(np.mean(lengths))
    if not lengths[2] > 0 or lengths[0] - lengths[2] > MOST_SKEW * scale:
        raise frame.fault(name, "its columns are not of equal length at right angles, so it is no rotation")
    faults = []
    if abs(scale - 1) > MOST_SKEW:
        faults.append(f"is scaled by {scale:.6g}, and a pose has the scale 1")
    exact = left @ right
    if np.linalg.det(exact) < 0:
        faults.append("is a reflection (determinant below 0): left-handed axes, or one with the wrong sign")
    if faults:
        raise frame.fault(name, "its rotation " + ", and ".join(faults))
    return exact

"""The file transforms.json of neural reconstruction (nerfstudio, Instant NGP, visionsim), read and checked.

The format is that of nerfstudio (docs/quickstart/data_conventions.md of its repository) and of Instant NGP.
visionsim names photon cubes instead of pictures, .npy files of the frames of a camera; a `file_path` at the
top is the cube of a single camera, with a pose for each frame. Cameras have the axes of OpenGL: X right,
Y up, looking along -Z, in metres.
"""

import json
import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pcii.base import InputError, visible
from pcii.exchange.number_files import VIEWS, picture_of
from pcii.exchange.stated_images import Note, warn
from pcii.store import first_fault

TRANSFORMS = "transforms.json"
MM_PER_M = 1000.0
MOST_POSES = 1 << 16
"""Frames of a file: a photon cube of visionsim has a pose for each of its frames, a thousand or more."""
MOST_PX = 0.1
"""What cameras may be off by: sections are means of views, and a tenth of a pixel blurs none visibly."""
MOST_SKEW = 1e-4
"""Of a rotation, from columns of unit length at right angles: at the edge of a picture of 2000 px a length
that is wrong by this share moves a point by 0.1 px; matrices of 6 decimals are 100 times closer."""
ROUNDING = 1e-9
"""Of numbers that are equal: metres, parts of a rotation, pixels."""
PINHOLES = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE")
"""Values of camera_model that, without distortion, are pinholes."""
DISTORTIONS = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "is_fisheye")
FOCAL = ("fl_x", "fl_y", "camera_angle_x", "camera_angle_y")
ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".exr")
"""Endings that NeRF's own files leave out of the names of pictures."""

Positive = Annotated[float, Field(ge=1e-9, le=1e9)] | None
Number = Annotated[float, Field(ge=-1e9, le=1e9)]
Pixels = Annotated[int, Field(ge=1, le=1 << 20)] | None
Row = tuple[Number, Number, Number, Number]


class _Lens(BaseModel):
    """Intrinsics, which a frame may have or the top of the file for all."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)
    w: Pixels = None
    h: Pixels = None
    fl_x: Positive = None
    fl_y: Positive = None
    cx: Number | None = None
    cy: Number | None = None
    camera_angle_x: Annotated[float, Field(gt=0, lt=math.pi)] | None = None
    camera_angle_y: Annotated[float, Field(gt=0, lt=math.pi)] | None = None
    camera_model: str | None = None
    is_fisheye: bool | None = None
    k1: Number | None = None
    k2: Number | None = None
    k3: Number | None = None
    k4: Number | None = None
    k5: Number | None = None
    k6: Number | None = None
    p1: Number | None = None
    p2: Number | None = None
    distortion_params: list[Number] | None = None


class _Frame(_Lens):
    file_path: str | None = None
    transform_matrix: Annotated[list[Row], Field(min_length=3, max_length=4)]


class _Document(_Lens):
    frames: Annotated[list[_Frame], Field(min_length=1, max_length=MOST_POSES)]
    applied_scale: Positive = None
    file_path: str | None = None
    bitpack: bool | None = None
    bitpack_dim: int | None = None
    c: Annotated[int, Field(ge=1, le=4)] | None = None
    cfa: str | None = None


@dataclass(frozen=True, eq=False)
class TransformsFile:
    """What the file says of its N frames, which are in the order of the file."""

    path: Path
    poses: np.ndarray
    """Camera-to-world matrices (N, 4, 4), float64: axes of OpenGL, metres; rotations are exact ones."""
    centres_px: np.ndarray
    """Principal points (N, 2) as (x, y), the first pixel's centre at 0.5."""
    focal_px: float
    width: int
    height: int
    file_paths: tuple[Path, ...]
    """Picture or photon cube of each frame."""
    has_cubes: bool
    is_bitpacked: bool
    """Whether cubes have eight pixels in a byte."""
    channels: int | None
    """Channels of photon cubes, None if the file does not say."""
    cfa: str | None
    """Bayer pattern of photon cubes, None if the file has none."""

    def frame_name(self, number: int) -> str:
        """What messages call a frame: the path of its picture or cube."""
        return visible(self.file_paths[number].relative_to(self.path.parent).as_posix())


def read_transforms(path: str | Path, *, note: Note = warn) -> TransformsFile:
    """Read a transforms.json of anybody, or that of a folder.

    A picture is opened only where the file does not say its size. Intrinsics of a frame win over those at the
    top; without `fl_x` an angle of view tells the focal length. Places are divided by `applied_scale`. `note`
    takes the names of members that are not used. Raises `InputError`, naming file and member, for what is
    missing or wrong, pixels that are not square, lenses that distort, frames of different size or focal
    length, matrices that are no poses, paths that are used twice or lead out of the folder, photon cubes that
    are not packed along the width, and a single cube whose camera moves.
    """
    file = Path(path) / TRANSFORMS if Path(path).is_dir() else Path(path)
    if not file.is_file():
        raise InputError(f"{file}: there is no such file; expected a transforms.json as nerfstudio reads it")
    content = file.read_bytes()
    try:
        document = _Document.model_validate(json.loads(content))
    except ValidationError as fault:
        raise InputError(f"{file}: {first_fault(fault)}") from None
    except (ValueError, RecursionError) as fault:
        raise InputError(f"{file}: damaged, it is not valid JSON ({visible(str(fault))})") from None
    frames, is_single_cube = document.frames, document.file_path is not None
    paths = _paths(file, document)
    has_cubes = is_single_cube or document.bitpack is True or any(path.suffix == ".npy" for path in paths)
    if has_cubes and any(path.suffix != ".npy" for path in paths):
        raise InputError(f"{file}: file_path: expected .npy files, since photon cubes are in such files")
    if document.bitpack and document.bitpack_dim not in (None, 2):
        raise InputError(f"{file}: bitpack_dim: expected 2, the width, got {document.bitpack_dim}")
    if None in (document.w or frames[0].w, document.h or frames[0].h):
        if has_cubes:
            raise InputError(f"{file}: w, h: missing; the width and height of the frames in pixels")
        document.h, document.w, _ = picture_of(paths[0], VIEWS).shape
    (width, height, focal_px), centres_px = _common_lens(file, document)
    poses = _poses(file, frames)
    poses[:, :3, 3] /= document.applied_scale or 1
    if is_single_cube:
        if np.ptp(poses, axis=0).max() + np.ptp(centres_px, axis=0).max() > ROUNDING:
            raise InputError(f"{file}: frames: the camera moves, and a moving camera is no grid")
        poses, centres_px = poses[:1], centres_px[:1]
    extras = [name for lens in (document, *frames) for name in lens.model_extra or {}]
    if not has_cubes:
        extras += [name for name in ("cfa", "c") if getattr(document, name) is not None]
    if extras:
        note(f"not used of {file.name}: {visible(', '.join(dict.fromkeys(extras)))[:200]}")
    return TransformsFile(
        path=file,
        poses=poses,
        centres_px=centres_px,
        focal_px=focal_px,
        width=width,
        height=height,
        file_paths=paths,
        has_cubes=has_cubes,
        is_bitpacked=document.bitpack is True,
        channels=document.c,
        cfa=None if document.cfa == "none" else document.cfa,
    )


def _paths(file: Path, document: _Document) -> tuple[Path, ...]:
    """The picture or cube of each frame, or that of a single camera; without its ending if that is found.

    Raises `InputError` for a path that leads out of the folder, and for one of two frames.
    """
    members = {"file_path": document.file_path}
    if document.file_path is None:
        members = {f"frames.{n}.file_path": frame.file_path for n, frame in enumerate(document.frames)}
    folder, paths = file.parent.resolve(), []
    for member, text in members.items():
        inside = PurePosixPath((text or "").replace("\\", "/"))
        is_plain = bool(inside.parts) and not inside.is_absolute() and "\0" not in str(inside)
        if not is_plain or not (folder / inside).resolve().is_relative_to(folder):
            raise InputError(f"{file}: {member}: expected a path inside the folder such as images/00_00.png")
        path = file.parent / inside
        if not path.exists():
            endings = (path.with_name(path.name + ending) for ending in ENDINGS)
            path = next((other for other in endings if other.is_file()), path)
        paths.append(path)
    (path, count), *_ = Counter(paths).most_common(1)
    if count > 1:
        name = path.relative_to(file.parent).as_posix()
        raise InputError(f"{file}: frames: {name} is the file_path of {count} of them")
    return tuple(paths)


def _common_lens(file: Path, document: _Document) -> tuple[tuple[int, int, float], np.ndarray]:
    """Width, height and focal length in px, alike in all frames, and their principal points (N, 2)."""
    top = document.model_dump(exclude={"frames"}, exclude_none=True)
    first, centres = None, []
    for number, frame in enumerate(document.frames):
        of_frame = frame.model_dump(exclude_none=True)
        stated, place = top | of_frame, f"frames.{number}"
        if any(map(stated.get, DISTORTIONS)) or any(stated.get("distortion_params", ())):
            raise InputError(
                f"{file}: {place}: the lens distorts (k1, is_fisheye ...); undistort the pictures"
            )
        if stated.get("camera_model", "PINHOLE") not in PINHOLES:
            raise InputError(
                f"{file}: camera_model: expected one of {', '.join(PINHOLES)}; pictures of other lenses are "
                "undistorted first"
            )
        if not {"w", "h"} <= stated.keys():
            raise InputError(f"{file}: {place}: w, h: missing; the width and height of the frame in pixels")
        width, height = stated["w"], stated["h"]
        lens = of_frame if any(name in of_frame for name in FOCAL) else top
        focal_px = _focal_px(file, lens, width, height)
        first = first or (width, height, focal_px)
        is_other_focal = abs(focal_px - first[2]) * max(width, height) / 2 > MOST_PX * first[2]
        if (width, height) != first[:2] or is_other_focal:
            raise InputError(
                f"{file}: {place}: {height} x {width} px and a focal length of {focal_px:g} px, where the "
                f"first frame has {first[1]} x {first[0]} and {first[2]:g}; cameras of a grid are alike"
            )
        centres.append((stated.get("cx", width / 2), stated.get("cy", height / 2)))
    assert first is not None
    return first, np.array(centres)


def _focal_px(file: Path, lens: dict[str, Any], width: int, height: int) -> float:
    """Focal length in px, from that of either axis or an angle of view."""
    focal_px: list[float] = []
    for axis, size in (("x", width), ("y", height)):
        if f"fl_{axis}" in lens:
            focal_px.append(lens[f"fl_{axis}"])
        elif f"camera_angle_{axis}" in lens:
            focal_px.append(size / 2 / math.tan(lens[f"camera_angle_{axis}"] / 2))
    if not focal_px:
        raise InputError(f"{file}: fl_x: missing; the focal length in pixels, or camera_angle_x")
    across, down = focal_px[0], focal_px[-1]
    if abs(across - down) * max(width, height) / 2 > MOST_PX * across:
        raise InputError(
            f"{file}: fl_y: is {down:g} where fl_x is {across:g}; pixels that are not square are resampled"
        )
    return across


def _poses(file: Path, frames: list[_Frame]) -> np.ndarray:
    """The checked matrices (N, 4, 4) of frames, whose rotations are the nearest exact ones."""
    for number, frame in enumerate(frames):
        if frame.transform_matrix[3:] not in ([], [(0, 0, 0, 1)]):  # some leave the last row out
            raise InputError(f"{file}: frames.{number}.transform_matrix: expected 0 0 0 1 as its last row")
    poses = np.tile(np.eye(4), (len(frames), 1, 1))
    poses[:, :3] = [frame.transform_matrix[:3] for frame in frames]
    left, lengths, right = np.linalg.svd(poses[:, :3, :3])
    exact = left @ right
    is_skew = (np.abs(lengths - 1).max(axis=1) > MOST_SKEW) | (np.linalg.det(exact) < 0)
    if is_skew.any():
        number = int(np.argmax(is_skew))
        raise InputError(
            f"{file}: frames.{number}.transform_matrix: is no rotation; expected columns of length 1 at "
            f"right angles (they scale by {lengths[number].min():.6g} to {lengths[number].max():.6g}) and a "
            "determinant above 0"
        )
    poses[:, :3, :3] = exact
    return poses

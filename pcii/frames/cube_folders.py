"""Photon cubes of many cameras, or of one, that a transforms.json places.

Of a grid it has a frame for each camera, whose `file_path` is a cube, as `simgen export` writes it. Of one
camera it is a dataset of visionsim: one cube, and a pose for each of its frames.
"""

from dataclasses import dataclass, replace

import numpy as np

from pcii.base.errors import InputError
from pcii.core.bayer import check_cfa
from pcii.core.camera_grid import CameraGrid
from pcii.frames.frame_files import FrameFile, files_of_views
from pcii.frames.frame_sums import check_width
from pcii.io.dataset_writer import check_budget
from pcii.transforms.film_sizes import FilmSize, camera_grid_of
from pcii.transforms.grid_of_poses import find_grid
from pcii.transforms.parsed_members import Members
from pcii.transforms.transforms_file import TransformsFile

MOST_CHANNELS = 1 << 16
"""Beyond it is no number of channels."""
ROUNDING = 1e-9
"""Of numbers of poses that are equal: metres, or parts of a rotation."""


@dataclass(frozen=True, eq=False)
class CubeFolder:
    """Cubes (K, L) of `FrameFile`, their cameras, and what else the file says."""

    files: np.ndarray
    grid: CameraGrid
    cfa: str | None
    photon_budget: float | None
    notes: list[str]

    @property
    def frames(self) -> int:
        """Number of frames of each cube."""
        return self.files.flat[0].frames


def read_cube_folder(file: TransformsFile, film: FilmSize | None = None) -> CubeFolder:
    """Cameras and cubes of a transforms.json that says `bitpack`; of the cubes only the headers are read.

    Raises `InputError`, naming file and member, for cameras that are no grid, a camera that moves, and cubes
    that do not fit what the file says.
    """
    told = Members(file.path, "", file.document)
    if file.document.get("bitpack_dim") != 2:
        raise told.fault("bitpack_dim", "expected 2: bits that are packed along the width")
    if told.has("c") and told.whole("c", MOST_CHANNELS) != 1:
        raise told.fault("c", "expected 1; of a photon cube one channel is read")
    cfa = file.document.get("cfa")
    if cfa is not None and not isinstance(cfa, str):
        raise told.fault("cfa", "expected a Bayer pattern such as GRBG")
    try:
        check_cfa(cfa)
        budget = check_budget(told.number("photon_budget")) if told.has("photon_budget") else None
    except InputError as fault:
        named = str(fault).startswith(str(file.path))
        raise fault if named else InputError(f"{file.path}: {fault}") from None
    cameras = file if file.stack_path is None else _one_camera(file)
    found = find_grid(cameras)
    grid, notes = camera_grid_of(cameras, found, film)
    paths = np.empty(found.numbers.shape, object)
    for camera, number in np.ndenumerate(found.numbers):
        paths[camera] = file.path.parent / str(cameras.file_paths[number])
    files = files_of_views(paths, packed=True)
    first: FrameFile = files[0, 0]
    if first.height != file.height:
        raise InputError(
            f"{first.path}: is {first.height} px high, where {file.path.name} says {file.height}; the height "
            "is wrong, or bits are packed along another axis"
        )
    check_width(files, file.width, file.path.name)
    said = {"num_frames": told.number("num_frames")} if told.has("num_frames") else {}
    if file.stack_path is not None:
        said["frames"] = len(file.poses)
    for name, number in said.items():
        if number != first.frames:
            raise told.fault(name, f"says {number:g} frames, and {first.path} has {first.frames}")
    return CubeFolder(files, grid, cfa, budget, notes)


def _one_camera(file: TransformsFile) -> TransformsFile:
    """The file as one of a single camera; `InputError` if the poses or axes of its frames differ."""
    moved = np.ptp(file.poses, axis=0).max() + np.ptp(file.centres_px, axis=0).max()
    if moved > ROUNDING:
        raise InputError(
            f"{file.path}: frames: the camera moves from frame to frame, and a moving camera is no grid of "
            "cameras"
        )
    return replace(
        file,
        poses=file.poses[:1],
        centres_px=file.centres_px[:1],
        file_paths=(file.stack_path,),
        depth_paths=(None,),
        stack_path=None,
    )

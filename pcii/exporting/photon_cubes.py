"""Photon cubes: the binary frames of every view as one array of packed bits, with the poses of the cameras.

    03_04/frames.npy        uint8 (T, H, ceil(W / 8)) of the camera of row 3, column 4
    03_04/transforms.json   the same as a dataset of visionsim (NPY): a pose for each of the T frames
    transforms.json         all cameras, and the grid: see `written_poses`

Bits are packed along the width, the first pixel in the highest bit, as numpy.packbits does; bits beyond the
last pixel are 0. Blocks of a file without a set bit are not written: they are holes, which read as zeros and
take no room on the disk.
"""

import itertools
import json
from pathlib import Path
from typing import IO

import numpy as np

from pcii.base.errors import InputError
from pcii.core.photon_events import FrameEvents
from pcii.exchange.written_poses import MOST_POSES, TRANSFORMS, frames_of, intrinsics_of, principal_points_px
from pcii.exporting.view_names import row_and_column
from pcii.io.dataset import Dataset
from pcii.store.safe_files import json_bytes

FRAMES = "frames.npy"
BLOCK_BYTES = 4096
"""Of file systems: what is written in a block takes the room of all of it."""
MOST_BLOCKS = 256
"""Blocks beside each other that are written at once."""


def write_photon_cubes(dataset: Dataset, folder: Path) -> None:
    """Write a folder for each view, and what all have in common; memory grows with the photons alone.

    Raises `InputError` for counts that are not of one bit, and for frames that the dataset did not keep.
    """
    events, frames = _kept_frames(dataset)
    grid = dataset.grid
    members = intrinsics_of(dataset)
    cameras = frames_of(dataset)
    starts = np.searchsorted(events.k.astype(np.int64) * grid.cols + events.l, np.arange(grid.view_count + 1))
    axes = principal_points_px(dataset)
    lens = {name: members[name] for name in ("fl_x", "fl_y", "w", "h")}
    packed = {"c": 1, "cfa": dataset.cfa, "bitpack": True, "bitpack_dim": 2}
    listed = []
    for number, (k, l) in enumerate(np.ndindex(grid.rows, grid.cols)):
        view = folder / row_and_column(grid, k, l)
        view.mkdir()
        of_view = slice(starts[number], starts[number + 1])
        shape = (frames, grid.height, grid.width)
        _write_frames(view / FRAMES, shape, *(at[of_view] for at in (events.frame, events.i, events.j)))
        x, y = axes[k, l].tolist()
        pose = {"transform_matrix": cameras[number]["transform_matrix"]}
        alone = lens | {"cx": x, "cy": y} | packed | {"file_path": FRAMES, "frames": [pose] * frames}
        (view / TRANSFORMS).write_text(json.dumps(alone, allow_nan=False) + "\n")
        listed.append({"file_path": f"{view.name}/{FRAMES}"} | cameras[number])
    told = packed | {"num_frames": frames}
    if dataset.photon_budget is not None:
        told["photon_budget"] = float(dataset.photon_budget)
    (folder / TRANSFORMS).write_bytes(json_bytes(members | told | {"frames": listed}))


def _kept_frames(dataset: Dataset) -> tuple[FrameEvents, int]:
    """The single counts in the order of the views, and the number of frames."""
    if not dataset.has_counts:
        raise InputError(f"{dataset.path}: has no photon counts, and a photon cube is made of them")
    counts = dataset.counts
    frames, bits = counts.readout.frames, counts.readout.bits
    if bits != 1:
        what = "its counts have no limit" if bits is None else f"its frames are of {bits} bits"
        raise InputError(f"{dataset.path}: {what}, and the frames of a photon cube are of one bit")
    if frames > MOST_POSES:
        raise InputError(
            f"{dataset.path}: has {frames} frames, and a photon cube, which lists a pose for each, has at "
            f"most {MOST_POSES}"
        )
    events = counts.frame_events
    if events is None:
        raise InputError(
            f"{dataset.path}: has sums of {frames} frames, which were not kept; generate it with "
            "products.frames = true"
        )
    return events, frames


def _write_frames(
    path: Path, shape: tuple[int, int, int], frame: np.ndarray, i: np.ndarray, j: np.ndarray
) -> None:
    """Write frames (T, H, W) of which the pixels (i, j) of `frame` are set.

    Not through a memory map, in which a full disk ends the process without a word.
    """
    frames, height, width = shape
    row = -(-width // 8)
    place = (frame.astype(np.int64) * height + i) * row + j // 8
    order = np.argsort(place, kind="stable")
    place, bit = place[order], (128 >> (j[order] % 8)).astype(np.uint8)
    with path.open("wb") as file:
        header = {"descr": "|u1", "fortran_order": False, "shape": (frames, height, row)}
        np.lib.format.write_array_header_1_0(file, header)
        begin = file.tell()
        file.truncate(begin + frames * height * row)
        if not place.size:
            return
        first = np.flatnonzero(np.diff(place, prepend=-1))
        _write_blocks(file, begin, begin + place[first], np.bitwise_or.reduceat(bit, first))


def _write_blocks(file: IO[bytes], begin: int, place: np.ndarray, byte: np.ndarray) -> None:
    """Write bytes, whose places in the file ascend, with the zeros between them in their blocks."""
    block = place // BLOCK_BYTES
    apart = (np.diff(block) > 1) | (np.diff(block // MOST_BLOCKS) > 0)
    cuts = [0, *(np.flatnonzero(apart) + 1).tolist(), place.size]
    size = file.seek(0, 2)
    for low, high in itertools.pairwise(cuts):
        start = max(int(block[low]) * BLOCK_BYTES, begin)
        stop = min((int(block[high - 1]) + 1) * BLOCK_BYTES, size)
        content = np.zeros(stop - start, np.uint8)
        content[place[low:high] - start] = byte[low:high]
        file.seek(start)
        file.write(content.data)

"""The dataset folder on disk: its files, their arrays and its manifest.

    manifest.json            recipe as resolved, versions, timings, every file with size and SHA-256
    counts.zarr/             events k, l, i, j, n (event,) or dense counts (K, L, H, W)
    counts.zarr/frame        (photon,) the frame of each count, on request
    counts-300.zarr/         those of a smaller budget, if photons.nested asks for it
    photon_truth.zarr/       object_id, z_mm (photon,) of each photon's first hit, in the events' order
    truth.zarr/              maps (H, W) of the virtual centre, and of every view on request
    radiance/view_kk_ll.exr  float32, on request; one channel Y for a mosaic, else R, G, B
    arrays.zip               in place of the .zarr folders, where many small files would be a burden

The archive is a ZIP file as the zip stores of Zarr are: without compression, since chunks are compressed
already. Its members are in order and without dates, so that the same arrays make the same bytes.

The manifest is written last and lists what belongs to the dataset: a dataset without a manifest is
unfinished, a file whose hash differs is damaged, and what is not listed is not read.
"""

import io
import shutil
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pcii.base import InputError, write_bytes_safely
from pcii.store.folders import REMEDY, FolderKind

if TYPE_CHECKING:
    from pcii.store.manifests import DatasetManifest

MANIFEST = "manifest.json"
CARD, LICENCE = "README.md", "LICENSE"
"""What people read of a dataset or collection. No manifest lists them: terms of use may change."""
MARKER = ".unfinished.json"
"""Present in the folder of a dataset while it is being generated."""
COUNTS = "counts.zarr"
FRAME = "frame"
"""Array of the counts that has the frame of each."""
TRUTH = "truth.zarr"
PHOTON_TRUTH = "photon_truth.zarr"
RADIANCE = "radiance"
ARRAYS = "arrays.zip"
WORTH_ZIP = 0.9
"""Radiance is compressed if it then takes at most this share of its bytes."""
DATASET_FOLDER = FolderKind("dataset", MANIFEST, 2, "simgen generate", frozenset({MANIFEST, MARKER}))


def radiance_name(k: int, l: int) -> str:
    """Path of the radiance of a view in the dataset.

    >>> radiance_name(0, 12)
    'radiance/view_00_12.exr'
    """
    return f"{RADIANCE}/view_{k:02d}_{l:02d}.exr"


def nested_name(part: str, budget: float | None) -> str:
    """Name of an array group for a nested photon budget; unchanged for None.

    >>> nested_name("counts.zarr", 300.0)
    'counts-300.zarr'
    """
    if budget is None:
        return part
    stem, suffix = part.rsplit(".", 1)
    return f"{stem}-{budget:.12g}.{suffix}"


def write_manifest(root: Path, manifest: Mapping[str, Any]) -> None:
    """Write the manifest of a dataset, which makes the dataset a finished one."""
    DATASET_FOLDER.write(root, manifest)


def read_manifest(root: Path) -> "DatasetManifest":
    """The manifest of a finished dataset; `InputError` if it is unfinished, or the manifest is damaged."""
    if (root / MARKER).is_file():
        raise InputError(f"{root}: unfinished; the same `simgen generate` command goes on from here")
    return read_written_manifest(root)


def read_written_manifest(root: Path) -> "DatasetManifest":
    """The manifest that was written last, whether or not another process marks the dataset as its own."""
    from pcii.store.manifests import DatasetManifest

    return DATASET_FOLDER.read(root, DatasetManifest)


def write_exr_safely(path: Path, image: np.ndarray) -> None:
    """Write an image (H, W, C), C = 1 or 3, as float32 EXR, atomically; with ZIP compression if that pays.

    Every sixteenth row shows whether it does. Radiance of few samples is noise, of which ZIP saves 1 %, and
    takes four times as long to write and half as long again to read.
    """
    import OpenEXR

    some = np.asarray(image[::16], np.float32)
    pays = len(_exr(some, OpenEXR.ZIP_COMPRESSION)) < WORTH_ZIP * some.nbytes
    write_bytes_safely(path, _exr(image, OpenEXR.ZIP_COMPRESSION if pays else OpenEXR.NO_COMPRESSION))


def _exr(image: np.ndarray, compression: object) -> bytes:
    """Content of a float32 EXR file of an image (H, W, C)."""
    import OpenEXR

    names = ("Y",) if image.shape[2] == 1 else ("R", "G", "B")
    planes = {name: np.ascontiguousarray(image[..., c], np.float32) for c, name in enumerate(names)}
    content = io.BytesIO()  # the library takes no path whose name is not valid text
    with OpenEXR.File({"compression": compression, "type": OpenEXR.scanlineimage}, planes) as file:
        file.write(content)
    return content.getvalue()


def read_exr(path: Path, shape: tuple[int, ...] | None = None, content: bytes | None = None) -> np.ndarray:
    """A float32 image (H, W, C) from an EXR file with the channels Y, or R, G, B, or from its `content`.

    Raises `InputError` if it cannot be read or its shape is not `shape`, if given; the shape is checked in
    the header, before memory is allocated for the pixels.
    """
    import OpenEXR

    stored = io.BytesIO(path.read_bytes() if content is None else content)
    try:
        with OpenEXR.File(stored, header_only=True) as file:
            (left, top), (right, bottom) = (map(int, corner) for corner in file.header()["dataWindow"])
            has_y = any(channel.name == "Y" for channel in file.header()["channels"])
        names = ("Y",) if has_y else ("R", "G", "B")
        size = (bottom - top + 1, right - left + 1, len(names))
        if shape is not None and size != tuple(shape):
            raise InputError(f"{path}: expected an image {tuple(shape)}, got {size}")
        stored.seek(0)
        with OpenEXR.File(stored, separate_channels=True) as file:
            channels = file.channels()
            return np.stack([np.array(channels[name].pixels) for name in names], axis=-1)
    except InputError:
        raise
    except (KeyError, RuntimeError, TypeError, ValueError) as fault:
        raise InputError(f"{path}: cannot be read as an EXR image ({fault})") from None


def pack_arrays(root: Path, parts: Iterable[str]) -> list[str]:
    """Move the named folders of `root` into its archive; the paths of the files in it."""
    parts, content = list(parts), io.BytesIO()
    paths = [path for part in parts for path in sorted((root / part).rglob("*")) if path.is_file()]
    names = [path.relative_to(root).as_posix() for path in paths]
    with zipfile.ZipFile(content, "w") as archive:
        for name in names:
            archive.writestr(zipfile.ZipInfo(name), (root / name).read_bytes())
    write_bytes_safely(root / ARRAYS, content.getvalue())
    for part in parts:
        shutil.rmtree(root / part, ignore_errors=True)
    return names


def read_packed(path: Path, archive: bytes, names: Iterable[str]) -> dict[str, bytes]:
    """Content of files in the archive that was read from `path`; `InputError` for one that is missing."""
    try:
        with zipfile.ZipFile(io.BytesIO(archive)) as members:
            return {name: members.read(name) for name in names}
    except (KeyError, zipfile.BadZipFile) as fault:
        raise InputError(f"{path}: cannot be read ({fault}); {REMEDY}") from None

"""The dataset folder on disk: its layout, and writing that survives a kill.

    manifest.json            recipe as resolved, versions, timings, every file with size and SHA-256
    counts.zarr/             events k, l, i, j, n (N,) or dense counts (K, L, H, W)
    truth.zarr/              z_mm, object_id, normal, coverage (H, W) of the virtual centre, and in_focus
                             (Z, H, W); on request visible_views (H, W), and view_z_mm, view_object_id,
                             view_normal, view_coverage (K, L, H, W); its attributes say what each is
    photon_truth.zarr/       object_id, z_mm (photons,) of each photon's first hit, in the events' order
    radiance/view_kk_ll.exr  float32, on request; one channel Y for a mosaic, else R, G, B

A file is written beside its place, flushed to disk and renamed, so that whatever has its final name
is whole. The manifest is written last and lists what belongs to the dataset: a dataset without a
manifest is unfinished, and a file whose hash differs is damaged (a deleted Zarr chunk would
otherwise read as zeros, which look like darkness).
"""

import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from pcii.errors import InputError

FORMAT = "photon-integral-imaging dataset"
FORMAT_VERSION = 1
MANIFEST = "manifest.json"
COUNTS = "counts.zarr"
TRUTH = "truth.zarr"
PHOTON_TRUTH = "photon_truth.zarr"
RADIANCE = "radiance"

# One Zarr chunk is at most this many elements: a view or a million events.
CHUNK_ELEMENTS = 1 << 20


def radiance_name(k: int, l: int) -> str:
    """Path of one view's radiance inside the dataset."""
    return f"{RADIANCE}/view_{k:02d}_{l:02d}.exr"


def nested_name(part: str, budget: float | None) -> str:
    """Name of a part of the dataset for a smaller photon budget; the part's own name for None."""
    if budget is None:
        return part
    stem, suffix = part.rsplit(".", 1)
    return f"{stem}-{budget:.12g}.{suffix}"


def write_bytes_safely(path: Path, content: bytes) -> None:
    """Write a file so that it is either whole under its name or not there at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".tmp")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Flush a folder's entries (new names, renames) to disk."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_json_safely(path: Path, value: Any) -> None:
    """Write indented JSON safely; infinities and NaN are refused, since JSON has none."""
    text = json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)
    write_bytes_safely(path, (text + "\n").encode())


def write_arrays_safely(
    folder: Path, arrays: Mapping[str, np.ndarray], attributes: Mapping[str, Any]
) -> None:
    """Write a Zarr v3 group of arrays (zstd, crc32c per chunk) as a whole: all of it or nothing."""
    with new_group_safely(folder, attributes) as group:
        for name, array in arrays.items():
            stored = new_array(group, name, array.shape, array.dtype)
            if array.size:
                stored[...] = array


def new_array(group: Any, name: str, shape: tuple[int, ...], dtype: Any) -> Any:
    """An empty array in a group, to be filled by whole leading steps."""
    from zarr.codecs import Crc32cCodec, ZstdCodec

    codecs = [ZstdCodec(level=3), Crc32cCodec()]
    return group.create_array(name, shape=shape, dtype=dtype, chunks=_chunks(shape), compressors=codecs)


@contextmanager
def new_group_safely(folder: Path, attributes: Mapping[str, Any]) -> Iterator[Any]:
    """A new Zarr v3 group to write to, which stands in `folder` once the block has ended without fault."""
    import zarr

    temporary = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}.", suffix=".tmp"))
    try:
        group = zarr.open_group(temporary, mode="w", zarr_format=3, attributes=dict(attributes))
        yield group
        temporary.chmod(0o755)
        for file in temporary.rglob("*"):
            if file.is_file():
                with file.open("rb") as opened:
                    os.fsync(opened.fileno())
        if folder.exists():
            shutil.rmtree(folder)
        temporary.replace(folder)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise
    sync_folder(folder.parent)


def _chunks(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Whole trailing axes (a view) up to the chunk size; single steps of the leading ones."""
    chunks: list[int] = []
    room = CHUNK_ELEMENTS
    for size in reversed(shape):
        chunks.insert(0, max(1, min(size, room)))
        room //= max(1, size)
    return tuple(chunks)


def hash_file(path: Path) -> str:
    """SHA-256 of a file, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def list_files(root: Path, parts: list[str]) -> dict[str, dict[str, Any]]:
    """Size and SHA-256 of every file of the named parts of a dataset, by path relative to it."""
    entries: dict[str, dict[str, Any]] = {}
    for part in parts:
        top = root / part
        files = [top] if top.is_file() else sorted(p for p in top.rglob("*") if p.is_file())
        for file in files:
            name = file.relative_to(root).as_posix()
            entries[name] = {"bytes": file.stat().st_size, "sha256": hash_file(file)}
    return entries


def read_manifest(root: Path) -> dict[str, Any]:
    """The manifest of a finished dataset; `InputError` if there is none or it cannot be read."""
    path = root / MANIFEST
    if not root.is_dir():
        raise InputError(f"{root}: there is no such dataset folder")
    if not path.is_file():
        raise InputError(f"{root}: not a finished dataset (no {MANIFEST}); make one with `simgen generate`")
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as fault:
        raise InputError(f"{path}: damaged, it is not valid JSON ({fault}); generate it again") from None
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise InputError(f"{path}: not the manifest of a {FORMAT}")
    if manifest.get("format_version") != FORMAT_VERSION:
        raise InputError(
            f"{path}: format version {manifest.get('format_version')!r} is not supported; "
            f"this release reads version {FORMAT_VERSION}"
        )
    return manifest


def check_file(root: Path, name: str, entry: Mapping[str, Any], *, content: bool) -> None:
    """Raise `InputError` if a listed file is missing, has another size, or (`content`) another hash."""
    path = root / name
    if not path.is_file():
        raise InputError(f"{path}: listed in the manifest but missing; generate the dataset again")
    size = path.stat().st_size
    if size != entry["bytes"]:
        raise InputError(
            f"{path}: truncated or changed, {size} bytes where the manifest says {entry['bytes']}; "
            "generate the dataset again"
        )
    if content and hash_file(path) != entry["sha256"]:
        raise InputError(
            f"{path}: its content does not match the manifest's SHA-256; generate the dataset again"
        )


def write_exr_safely(path: Path, image: np.ndarray) -> None:
    """A float32 image (H, W, C), C = 1 or 3, as EXR with ZIP, whose checksum finds every bit flip."""
    import OpenEXR

    names = ("Y",) if image.shape[2] == 1 else ("R", "G", "B")
    planes = {name: np.ascontiguousarray(image[..., c], np.float32) for c, name in enumerate(names)}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with OpenEXR.File(header, planes) as file:
            file.write(str(temporary))
        with temporary.open("rb") as written:
            os.fsync(written.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def read_exr(path: Path) -> np.ndarray:
    """A float32 image (H, W, C) from an EXR file with the channels Y, or R, G, B."""
    import OpenEXR

    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = file.channels()
            names = ("Y",) if "Y" in channels else ("R", "G", "B")
            return np.stack([np.array(channels[name].pixels) for name in names], axis=-1)
    except (KeyError, RuntimeError, TypeError, ValueError) as fault:
        raise InputError(f"{path}: cannot be read as an EXR image ({fault})") from None


def sweep_temporaries(root: Path) -> None:
    """Remove what a killed run left half written."""
    for path in [*root.glob(".*.tmp"), *root.glob(f"{RADIANCE}/.*.tmp")]:
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)

"""Arrays in files: .npy and .npz of NumPy, .mat of MATLAB, and HDF5; a key names one of several.

A .npy file is mapped into memory, and read piece by piece; of other files an array is read whole.
"""

import zipfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base import InputError, visible
from pcii.exchange.pixel_files import LARGEST_BYTES, name_other_file

HDF5_START = b"\x89HDF\r\n\x1a\n"
MATLAB_HEAD_BYTES = 512
"""What MATLAB writes before the HDF5 content of a .mat file of version 7.3."""
LEAST_AXES = 3
"""Views have at least as many axes: the only such array of a file is read without a key."""
MOST_NAMED = 6
"""Largest number of arrays that a sentence names."""
FORMATS_EXTRA = 'pip install "photon-integral-imaging[formats]"'


def open_array(path: Path, key: str | None = None) -> np.ndarray:
    """The array of a .npy file, mapped into memory, or in memory that of a .npz, .mat or HDF5 file.

    `key` names one of several; it is not needed if one alone has at least three axes. Axes are in the order
    that the writing program shows: of .mat files that of MATLAB. Raises `InputError`, naming the file, for
    what is no array, for a key that it lacks, and for one that memory does not hold.
    """
    name_other_file(path)
    try:
        with path.open("rb") as file:
            head = file.read(MATLAB_HEAD_BYTES + len(HDF5_START))
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror or visible(str(fault))})") from None
    try:
        if HDF5_START in (head[: len(HDF5_START)], head[MATLAB_HEAD_BYTES:]):
            numbers = _read_hdf5(path, key, is_turned=head.startswith(b"MATLAB"))
        elif head.startswith(b"MATLAB 5.0") or path.suffix.lower() == ".mat":
            numbers = _read_matlab(path, key)
        elif zipfile.is_zipfile(path):
            numbers = _read_archive(path, key)
        elif key is not None:
            raise InputError(f"{path}: --key is for .npz, .mat and HDF5 files, and this has one array")
        else:
            numbers = np.load(path, mmap_mode="r", allow_pickle=False)
    except InputError:
        raise
    except MemoryError:
        raise InputError(f"{path}: its array is larger than the memory; save it as .npy") from None
    except Exception:  # damaged content raises various exceptions
        raise InputError(
            f"{path}: not an array of numbers in a .npy file, as numpy.save writes it, nor in a .npz, .mat "
            "or HDF5 file"
        ) from None
    return numbers


def _read_archive(path: Path, key: str | None) -> np.ndarray:
    """An array of a .npz file, in which objects may be beside it."""
    arrays: dict[str, np.ndarray] = {}
    with np.load(path, allow_pickle=False) as archive:
        for name in archive.files:
            with suppress(ValueError):  # of objects, which are not read
                arrays[name] = archive[name]
    return arrays[_chosen(path, key, {name: array.shape for name, array in arrays.items()})]


def _read_matlab(path: Path, key: str | None) -> np.ndarray:
    """An array of a .mat file of version 4 to 7.2, with its axes as MATLAB shows them."""
    from scipy.io import loadmat, whosmat

    shapes = {name: shape for name, shape, kind in whosmat(path) if kind not in ("char", "cell", "struct")}
    name = _chosen(path, key, shapes)
    return np.asarray(loadmat(path, variable_names=[name])[name])


def _read_hdf5(path: Path, key: str | None, is_turned: bool) -> np.ndarray:
    """An array of an HDF5 file; MATLAB stores axes from the last to the first, and these are turned back."""
    try:
        import h5py
    except ModuleNotFoundError:
        raise InputError(f"{path}: is an HDF5 file, which h5py reads; install it: {FORMATS_EXTRA}") from None
    shapes: dict[str, tuple[int, ...]] = {}
    with h5py.File(path, "r") as file:

        def note(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset) and item.dtype.kind in "biufc" and not name.startswith("#"):
                shapes[name] = item.shape[::-1] if is_turned else item.shape

        file.visititems(note)
        stored: Any = file[_chosen(path, key, shapes)]
        if stored.nbytes > LARGEST_BYTES:
            raise InputError(f"{path}: its array is more than {LARGEST_BYTES >> 30} GiB; save it as .npy")
        numbers = stored[()]
    return numbers.T if is_turned else numbers


def _chosen(path: Path, key: str | None, shapes: dict[str, tuple[int, ...]]) -> str:
    """The key of the array to read; `InputError`, naming those that there are, if it is not clear which."""
    large = [name for name, shape in shapes.items() if len(shape) >= LEAST_AXES]
    if key is None and len(large) == 1:
        return large[0]
    wanted = None if key is None else key.strip("/")
    if wanted in shapes:
        return wanted
    if not shapes:
        raise InputError(f"{path}: holds no array of numbers")
    names = [f"{name} {' x '.join(map(str, shape))}" for name, shape in shapes.items()]
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    which = "say which with --key" if key is None else f"and no {visible(key)}; correct --key"
    raise InputError(f"{path}: holds {visible(', '.join(names[:MOST_NAMED]))}{more}; {which}")

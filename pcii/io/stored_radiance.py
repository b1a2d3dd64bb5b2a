"""Radiance on disk, one EXR file per view, each read when it is used."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from pcii.io.dataset_layout import read_exr


class StoredRadiance:
    """Radiance (K, L, H, W, C), float32: [k, l] reads one view (H, W, C), `np.asarray` all of them.

    `file_of` (k, l) returns the path of the file of a view, which it has checked.
    """

    def __init__(self, shape: tuple[int, int, int, int, int], file_of: Callable[[int, int], Path]) -> None:
        self.shape = shape
        self.dtype = np.dtype(np.float32)
        self._file_of = file_of

    def __getitem__(self, index: tuple[int, int], /) -> np.ndarray:
        K, L = self.shape[:2]
        is_pair = (
            isinstance(index, tuple)
            and len(index) == 2
            and all(isinstance(n, int | np.integer) for n in index)
        )
        if not is_pair or not (0 <= index[0] < K and 0 <= index[1] < L):
            raise InputError(
                f"radiance: read one view of {K} x {L} by [k, l], or all by numpy.asarray; got {index!r}"
            )
        return read_exr(self._file_of(*index), self.shape[2:])

    def __array__(self, dtype: np.dtype | None = None, copy: bool | None = None) -> np.ndarray:
        """All views, read into memory; raises `ValueError` if NumPy asks for them without a copy."""
        if copy is False:
            raise ValueError("radiance: it is on disk, and only a copy can be in memory")
        views = np.empty(self.shape, self.dtype if dtype is None else dtype)
        for k, l in np.ndindex(*self.shape[:2]):
            views[k, l] = self[k, l]
        return views

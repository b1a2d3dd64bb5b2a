"""Memory of sections that nobody holds any more, for the next ones.

A section of 1024 x 1024 voxels in three colours is 12 MB. The system clears each page that it hands out,
which takes several times as long as adding the paper's photons, and the C library gives such blocks back to
the system whenever the end of its heap is free. So a few blocks are kept.
"""

import weakref
from collections import deque
from math import prod

import numpy as np

SMALLEST_BYTES = 1 << 20
"""Smaller blocks come from the heap, and are no cost."""
LARGEST_BYTES = 1 << 26
"""Larger ones are given back: nobody wants a program that keeps gigabytes."""
MOST_BLOCKS = 4
"""Sums and coverage of two sections that are compared."""


class _Block:
    """Memory that can be found by identity; arrays are compared by value."""

    def __init__(self, size: int) -> None:
        self.memory = np.empty(size, np.uint8)


class _Lease:
    """Memory while arrays use it: all of them keep this alive, so its end is theirs."""

    def __init__(self, block: _Block) -> None:
        self.__array_interface__ = block.memory.__array_interface__


_free: deque[_Block] = deque(maxlen=MOST_BLOCKS)


def empty(shape: tuple[int, ...], dtype: np.dtype | type) -> np.ndarray:
    """An array with any content, as `numpy.empty`; its memory is kept for another one of the same size."""
    size = prod(shape) * np.dtype(dtype).itemsize
    if not SMALLEST_BYTES <= size <= LARGEST_BYTES:
        return np.empty(shape, dtype)
    block = _taken(size) or _Block(size)
    lease = _Lease(block)
    weakref.finalize(lease, _free.append, block).atexit = False
    return np.asarray(lease).view(dtype).reshape(shape)


def _taken(size: int) -> _Block | None:
    for block in tuple(_free):
        if block.memory.size == size:
            try:
                _free.remove(block)
            except ValueError:  # another thread took it
                continue
            return block
    return None

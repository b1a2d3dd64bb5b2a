"""Memory is handed on only when nothing looks at it any more."""

import gc
import threading

import numpy as np

from pcii.sections import recycled_memory
from pcii.sections.recycled_memory import MOST_BLOCKS, empty

SHAPE = (3, 512, 512)


def address(array: np.ndarray) -> int:
    return array.__array_interface__["data"][0]


def test_memory_is_used_again_once_no_view_of_it_is_left():
    first = empty(SHAPE, np.int32)
    place, view = address(first), first[1, ::2].T
    del first
    other = empty(SHAPE, np.int32)
    assert address(other) != place  # a view of a view still looks at it
    other[:], view[:] = 1, 2
    assert (other == 1).all()
    assert (view == 2).all()
    del view
    gc.collect()
    assert place in {address(each) for each in [empty(SHAPE, np.int32) for _ in range(MOST_BLOCKS)]}


def test_arrays_are_plain_and_of_any_type_and_size():
    for shape, dtype in ((SHAPE, np.uint16), (SHAPE, np.float64), ((0, 4), np.int64), ((2, 2), np.int32)):
        array = empty(shape, dtype)
        assert type(array) is np.ndarray
        assert (array.shape, array.dtype) == (shape, dtype)
        assert array.flags.c_contiguous
        assert array.flags.aligned
        assert array.flags.writeable


def test_only_a_few_blocks_are_kept():
    held = [empty(SHAPE, np.int32) for _ in range(3 * MOST_BLOCKS)]
    del held
    gc.collect()
    assert len(recycled_memory._free) == MOST_BLOCKS


def test_threads_never_share_memory():
    mixed = []

    def work(number: int) -> None:
        for _ in range(50):
            array = empty((1 << 20,), np.uint8)
            array[:] = number
            if (array != number).any():
                mixed.append(number)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not mixed

"""Frames of one bit a pixel, eight pixels in a byte: their sums, and the places of set bits.

The first pixel of a row is in the highest bit of its first byte, as numpy.packbits has it.
"""

import numpy as np

MOST_FRAMES_AT_ONCE = 255
"""Their sum fits in a byte."""


def packed_row(width: int) -> int:
    """Bytes of a row of so many pixels."""
    return -(-width // 8)


def has_padding_set(frames: np.ndarray, width: int) -> bool:
    """Whether a bit beyond the last of `width` pixels is set in packed frames (n, H, ceil(width / 8))."""
    unused = 8 * frames.shape[2] - width
    return unused > 0 and bool((frames[:, :, -1] & ((1 << unused) - 1)).any())


def number_set(frames: np.ndarray) -> int:
    """Number of set bits in packed frames, a contiguous array."""
    return int(np.bitwise_count(_words(frames.reshape(1, -1))).sum(dtype=np.int64))


def places_set(frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frame, row and column of each set bit of packed frames (n, H, row), three arrays of int64.

    >>> frames = np.packbits([[[0, 1, 0, 0, 0, 0, 0, 0, 1, 1]]], axis=2)
    >>> [index.tolist() for index in places_set(frames)]
    [[0, 0, 0], [0, 0, 0], [1, 8, 9]]
    """
    words = _words(frames.reshape(1, -1))[0]
    seen = np.flatnonzero(words)
    of_seen, bit = np.nonzero(np.unpackbits(words[seen][:, None].view(np.uint8), axis=1))
    byte = seen[of_seen] * words.itemsize + bit // 8
    frame, byte = np.divmod(byte, frames.shape[1] * frames.shape[2])
    i, byte = np.divmod(byte, frames.shape[2])
    return frame, i, 8 * byte + bit % 8


def sum_of_frames(frames: np.ndarray) -> np.ndarray:
    """Sum (H, 8 row) of packed frames (n, H, row), n up to `MOST_FRAMES_AT_ONCE`, uint8.

    All pixels of a word are added at once: three words of a weight make one of it and one of twice that, the
    sums and the carries of full adders (Harley and Seal; Warren, "Hacker's Delight", 2nd ed., section 5-1).

    >>> sum_of_frames(np.packbits([[[0, 1, 1]], [[0, 0, 1]], [[0, 1, 1]]], axis=2))[0, :3].tolist()
    [0, 2, 3]
    """
    n, height, row = frames.shape
    of_weight = [*_words(frames.reshape(n, -1))]
    total = np.zeros(8 * height * row, np.uint8)
    weight = 0
    while of_weight:
        carries = []
        while len(of_weight) > 1:
            x, y = of_weight.pop(), of_weight.pop()
            differ = x ^ y
            carry = x & y
            if of_weight:
                z = of_weight.pop()
                carry |= differ & z
                differ ^= z
            of_weight.append(differ)
            carries.append(carry)
        total += np.unpackbits(of_weight[0].view(np.uint8)) << np.uint8(weight)
        of_weight, weight = carries, weight + 1
    return total.reshape(height, 8 * row)


def _words(rows: np.ndarray) -> np.ndarray:
    """Contiguous rows of bytes as rows of words of eight, or as they are where they are no multiple of it."""
    return rows.view(np.uint64) if rows.shape[1] % 8 == 0 else rows

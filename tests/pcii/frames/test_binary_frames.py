"""Packed bits: sums and places against NumPy's own unpacking, of frames that fill words or do not."""

import numpy as np
import pytest

from pcii.frames.binary_frames import has_padding_set, number_set, packed_row, places_set, sum_of_frames


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 1.0])
@pytest.mark.parametrize("shape", [(1, 1, 1), (2, 3, 5), (3, 4, 16), (255, 2, 33), (64, 8, 64)])
def test_sums_and_places_are_those_of_unpacked_bits(shape: tuple[int, int, int], share: float) -> None:
    bits = np.random.default_rng(3).random(shape) < share
    frames = np.packbits(bits, axis=2)
    assert frames.shape[2] == packed_row(shape[2])
    np.testing.assert_array_equal(sum_of_frames(frames)[:, : shape[2]], bits.sum(axis=0))
    np.testing.assert_array_equal(np.stack(places_set(frames), axis=1), np.argwhere(bits))
    assert number_set(frames) == bits.sum()
    assert not has_padding_set(frames, shape[2])


def test_every_padding_bit_is_seen() -> None:
    for bit in range(8):
        frames = np.zeros((2, 3, 2), np.uint8)
        frames[1, 2, 1] = 128 >> bit
        assert [has_padding_set(frames, width) for width in range(9, 17)] == [
            8 + bit >= width for width in range(9, 17)
        ]

"""Random numbers of light paths are those of their definition for all time."""

import numpy as np
import pytest

from simgen.renderer import backend, streams_for

pytestmark = pytest.mark.skipif(
    backend.choose().kind == "scalar", reason="scalar mode has the numbers of NumPy and of Mitsuba"
)
WORD = (1 << 64) - 1


def drawn(seed: int, part: int, lanes: int, draws: int) -> np.ndarray:
    """Numbers (draw, lane), uint32."""
    stream = streams_for(backend.load(), seed, lanes, part=part).generator
    numbers = [stream.next_uint32() for _ in range(draws)]
    backend.load_drjit().eval(numbers)
    return np.stack([np.array(number) for number in numbers])


def by_definition(seed: int, part: int, lane: int, draws: int) -> list[int]:
    """Numbers of a lane in whole numbers of Python: SplitMix64 gives state and increment of PCG32."""

    def split_mix(begin: int) -> int:
        z = begin + (lane + 1) * 0x9E3779B97F4A7C15 & WORD
        z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & WORD
        z = (z ^ z >> 27) * 0x94D049BB133111EB & WORD
        return z ^ z >> 31

    begins = np.random.SeedSequence(seed, spawn_key=(part,)).generate_state(2, np.uint64)
    start, increment = (split_mix(int(begin)) for begin in begins)
    increment = increment << 1 & WORD | 1
    state = (start + increment) * 6364136223846793005 + increment & WORD
    numbers = []
    for _ in range(draws):
        word, turn = (state >> 18 ^ state) >> 27 & 0xFFFFFFFF, state >> 59
        numbers.append((word >> turn | word << (-turn & 31)) & 0xFFFFFFFF)
        state = state * 6364136223846793005 + increment & WORD
    return numbers


def test_numbers_are_those_of_their_definition_for_all_time() -> None:
    seed = 3 << 100 | 5
    numbers = drawn(seed, part=1, lanes=1000, draws=4)
    for lane in (0, 1, 7, 999):
        assert numbers[:, lane].tolist() == by_definition(seed, 1, lane, 4)


def test_paths_draw_numbers_only_where_they_go_on() -> None:
    mi, dr = backend.load(), backend.load_drjit()
    every, some = (streams_for(mi, 1, 8) for _ in range(2))
    first, second = np.array(every.next_1d()), np.array(every.next_1d())
    point = every.next_2d()
    goes_on = dr.arange(mi.UInt32, 8) % 2 == 0
    assert (np.array(some.next_1d(goes_on))[::2] == first[::2]).all()
    found = np.array(some.next_1d())
    assert (found[::2] == second[::2]).all()
    assert (found[1::2] == first[1::2]).all()
    assert (np.array(point)[:, ::2] == np.array(some.next_2d())[:, ::2]).all()
    assert ((found >= 0) & (found < 1)).all()

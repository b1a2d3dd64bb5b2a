"""Random numbers of light paths: those of their definition for all time, and others for each seed."""

import hashlib

import numpy as np
import pytest

from simgen.renderer import backend, streams_for

pytestmark = pytest.mark.skipif(
    backend.choose().kind == "scalar", reason="scalar mode has the numbers of NumPy and of Mitsuba"
)
LANES, DRAWS = 4096, 32
WORD = (1 << 64) - 1


def drawn(seed: int, part: int = 0, lanes: int = LANES, draws: int = DRAWS) -> np.ndarray:
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
    assert hashlib.sha256(numbers.astype("<u4").tobytes()).hexdigest()[:16] == "f5e6cd72e337f982"


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


def likeness(one: np.ndarray, other: np.ndarray) -> float:
    """Largest correlation between numbers of two sets, draw by draw, in deviations of independent ones."""
    a, b = (part.reshape(part.shape[0], -1) / 2**32 - 0.5 for part in (one, other))
    return float(np.abs((a * b).sum(axis=1)).max() * 12 / np.sqrt(a.shape[1]))


def test_seeds_parts_and_lanes_share_nothing() -> None:
    own = drawn(7)
    # Equal in the low 32 or 64 bits, next to each other, and another part of the same work.
    others = [drawn(7 + (1 << 32)), drawn(7 + (1 << 64)), drawn(7 + (1 << 127)), drawn(8), drawn(7, part=1)]
    pairs = [(own, other) for other in others]
    pairs += [(own[:, step:], own[:, :-step]) for step in (1, 2, 256)]
    pairs += [(own[step:], own[:-step]) for step in (1, 2)]
    # Of 10 x 32 normal numbers one is beyond 6 in a million cases.
    assert max(likeness(*pair) for pair in pairs) < 6
    assert len(np.unique(np.concatenate([own[0], *(other[0] for other in others)]))) > 6 * LANES - 4
    bits = own[:, :, None] >> np.arange(32, dtype=np.uint32) & 1
    excess = (bits.sum(axis=1) - LANES / 2) / np.sqrt(LANES / 4)  # of each bit of each draw
    assert abs(float((excess**2).sum()) - DRAWS * 32) < 6 * np.sqrt(2 * DRAWS * 32)
    taken = 7 + (1 << 32) & 0xFFFFFFFF
    assert likeness(own, drawn(taken)) > 6  # the fault: of a seed 32 bits are taken


def test_seeds_share_their_kernels() -> None:
    dr = backend.load_drjit()

    def kernels(seed: int) -> list[str | None]:
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            drawn(seed, lanes=64, draws=2)
            return [kernel.get("hash") for kernel in dr.kernel_history()]

    assert kernels(1) == kernels(2 << 64 | 3)

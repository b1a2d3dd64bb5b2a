"""Random numbers of light paths in compiled backends: a stream in each lane, of a seed of any size.

Samplers of Mitsuba take seeds of 32 bits, which some 80 000 datasets are enough to make equal in two of them.
All here is arithmetic of integers, so numbers are the same on every machine.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from simgen.renderer.backend import load_drjit, opaque

GOLDEN = 0x9E3779B97F4A7C15
"""2^64 over the golden ratio: the step of SplitMix64."""


@dataclass
class RandomNumbers:
    """PCG32 (O'Neill 2014) in each lane; what Mitsuba asks a sampler for, and a state of Dr.Jit's loops."""

    mi: Any
    generator: Any

    def next_1d(self, active: Any = True) -> Any:
        """A number in [0, 1) in each lane; the streams of lanes that are not active stay where they are."""
        return self.generator.next_float32(active)

    def next_2d(self, active: Any = True) -> Any:
        """Two numbers in [0, 1) in each lane."""
        return self.mi.Point2f(self.next_1d(active), self.next_1d(active))


def streams_for(mi: Any, seed: int, size: int, *, part: int = 0) -> RandomNumbers:
    """Streams for `size` lanes, of this `part` of the work that `seed` is for.

    State and increment of each lane, of 64 and 63 bits, are numbers of SplitMix64 (Steele et al. 2014), which
    begins at 128 bits that seed and part decide.
    """
    begins = np.random.SeedSequence(seed, spawn_key=(part,)).generate_state(2, np.uint64)
    step = (load_drjit().arange(mi.UInt64, size) + 1) * mi.UInt64(GOLDEN)
    state, increment = (_mixed(mi, opaque(mi.UInt64, int(begin)) + step) for begin in begins)
    generator = mi.PCG32()
    generator.seed(state, increment)
    return RandomNumbers(mi, generator)


def _mixed(mi: Any, number: Any) -> Any:
    """The bits of each number mixed; every number has one that becomes it."""
    number = (number ^ (number >> 30)) * mi.UInt64(0xBF58476D1CE4E5B9)
    number = (number ^ (number >> 27)) * mi.UInt64(0x94D049BB133111EB)
    return number ^ (number >> 31)

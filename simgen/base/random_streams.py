"""Random streams, keyed (scene, view, stage): the same for any number of workers and any order.

The key is a `SeedSequence.spawn_key` of fixed length, since seeds given as lists of numbers collide
when one list is another with zeros appended.
"""

from typing import Literal, get_args

import numpy as np

Stage = Literal[
    "radiance",
    "photons",
    "totals",
    "pilot",
    "paths",
    "nested",
    "detection",
    "faulty pixels",
    "saturation",
    "full light",
    "probe",
    "camera errors",
]
_STAGES: tuple[Stage, ...] = get_args(Stage)


def _sequence(seed: int, view: int, stage: Stage, part: int, scene: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(seed, spawn_key=(scene, view, _STAGES.index(stage), part))


def generator(seed: int, *, view: int, stage: Stage, part: int = 0, scene: int = 0) -> np.random.Generator:
    """NumPy's generator of one view and stage; `part` counts repetitions of a stage."""
    return np.random.default_rng(_sequence(seed, view, stage, part, scene))


def integer(seed: int, *, view: int, stage: Stage, part: int = 0, scene: int = 0) -> int:
    """A 32-bit seed of one view and stage, for the renderer."""
    return int(_sequence(seed, view, stage, part, scene).generate_state(1)[0])

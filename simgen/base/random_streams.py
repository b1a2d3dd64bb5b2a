"""Random streams, keyed by what is drawn and by stage of the work: the same for any workers and any order.

Each purpose has a stage of its own. The key is a `SeedSequence.spawn_key` of fixed length, since seeds given
as lists of numbers collide when one list is another with zeros appended.
"""

from typing import Any, Literal, get_args

import numpy as np

from pcii.store import hash_json

Stage = Literal[
    "radiance",
    "photons",
    "full light",
    "camera errors",
    "detection",
    "faulty pixels",
    "saturation",
    "budget totals",
    "nested totals",
    "nested ranks",
    "first pilot",
    "second pilot",
    "warm-up",
    "exposure candidates",
    "candidate paths",
    "plan probe",
    "check probe",
    "frames",
    "aimed pilot",
    "emission candidates",
    "candidate numbers",
    "candidate times",
    "lamp rays",
]
OF_THE_CAMERAS: tuple[Stage, ...] = ("camera errors", "faulty pixels")
"""Stages that describe the cameras themselves. They depend on the recipe's seed alone, so that the same
cameras photograph every scene."""
_SEED_BITS = 64
"""A recipe's seed is below 2^63, and is the rest of a draw's seed after division by 2^64."""


def seed_of_draw(seed: int, drawn: Any) -> int:
    """The seed of one draw: the recipe's seed in the low 64 bits, a hash of `drawn` above it.

    `drawn` holds the values, as JSON has them, that determine the draw.
    """
    return int(hash_json(drawn)[:32], 16) << _SEED_BITS | seed


def generator(
    seed: int, *, stage: Stage, view: int = 0, part: int = 0, round_number: int = 0
) -> np.random.Generator:
    """NumPy's generator of a stage: of one view, of one part of the stage's work, of one round."""
    if stage in OF_THE_CAMERAS:
        seed %= 1 << _SEED_BITS
    key = (get_args(Stage).index(stage), view, part, 0, round_number)  # the 0 keeps streams as they were
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


def integer(seed: int, *, stage: Stage, view: int = 0, part: int = 0, round_number: int = 0) -> int:
    """A seed of 128 bits for light paths, of a stage as for `generator`."""
    rng = generator(seed, stage=stage, view=view, part=part, round_number=round_number)
    low, high = rng.bit_generator.seed_seq.generate_state(2, np.uint64)
    return int(high) << 64 | int(low)

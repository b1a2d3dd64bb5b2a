"""Which sampler of candidates: all at once where a compiled backend runs, else one by one."""

from collections.abc import Sequence

import numpy as np

from simgen.photons.candidates import CandidateSampler, Setup
from simgen.photons.majorant import Majorant
from simgen.photons.scalar_sampler import ScalarSampler
from simgen.photons.wavefront_sampler import WavefrontSampler
from simgen.renderer.backend import is_scalar
from simgen.renderer.path_tracing import surrounding_radiance
from simgen.renderer.wavelengths import light_of


def sampler_for(
    setup: Setup,
    majorant: Majorant,
    groups: Sequence[np.ndarray],
    ambient: np.ndarray,
    below: Majorant | None = None,
) -> CandidateSampler:
    """Candidates of groups of Bayer cells (2 a + b) by `majorant`, in light of `ambient` (C,) all around.

    With `below` those of what lies between the two majorants (see `CandidateSampler`).
    """
    if is_scalar(setup.render_scene.mi):
        return ScalarSampler(setup, majorant, groups, below)
    return WavefrontSampler(setup, majorant, groups, ambient, below)


def surroundings(setup: Setup) -> np.ndarray:
    """What pixels see of what shines from all around (C,), where candidates are guessed at; else zeros."""
    if is_scalar(setup.render_scene.mi):
        return np.zeros(setup.channels)
    return surrounding_radiance(setup.render_scene, light_of(setup.render_scene, setup.cfa))

"""Evidence of depth from texture: how likely is the contrast that a section shows, scale by scale?

In focus a section shows the texture of the surface; out of focus the views average it away, and what is left
is photon noise. The section is divided into octaves (the Laplacian pyramid of Burt and Adelson 1983). A
coefficient y of an octave, where the mean rate around is b, is normal with variance

    m = e b / n + (eta b)^2         if the plane is out of focus: photon noise, and imperfect averaging,
    m + (c b)^2                     if it is in focus: texture of contrast c in each octave,

n the samples of a block and e the energy of the octave's kernel. With r = (c b)^2 / m and
t = y^2 / (m + (c b)^2) the logarithm of the ratio of likelihoods is

    (r t - log(1 + r)) / 2,    with k t / (k + t) in place of t:

outlines have far more contrast than texture, and would otherwise decide on the depth of all that is around
them. Where there is little light r is small in fine octaves and coarse ones decide; where there is much, fine
ones do. So the scale follows the light.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache

import numpy as np

from pcii.core.focal_planes import FocalPlanes
from pcii.core.photon_counts import PhotonCounts
from pcii.sections.photon_statistics import cell_sums
from pcii.sections.reconstruction import reconstruct

BLOCK_PX = 2
"""Sections are summed over blocks of 2 x 2 pixels, in which a mosaic has all colours for any shift."""


@dataclass(frozen=True)
class TextureModel:
    """Constants of the model: c, eta and k of the equations above."""

    contrast: float = 0.1
    averaging_error: float = 0.02
    saturation: float = 4.0
    octaves: int = 4
    """The finest is that of blocks of 2 px, the coarsest of 16 px."""


def evidence_of_texture(
    counts: PhotonCounts, planes: FocalPlanes, model: TextureModel | None = None
) -> np.ndarray:
    """Evidence (Z, ceil(H / 2), ceil(W / 2)) float32, in nats for each block of 2 x 2 pixels.

    The sum over a window is the logarithm of how much likelier its photons are if the surface is at this
    plane than if it is at none.
    """
    from pcii.base.compiled_loops import threads

    chosen = model or TextureModel()

    def of_plane(plane: int) -> np.ndarray:
        section = reconstruct(counts, planes.take([plane]))
        photons, samples = (
            cell_sums(sums[0].sum(axis=-1), BLOCK_PX, np.float32)
            for sums in (section.counts, section.coverage)
        )
        return _of_section(photons, samples, chosen)

    with ThreadPoolExecutor(threads()) as pool:
        return np.stack(list(pool.map(of_plane, range(len(planes)))))


def _of_section(photons: np.ndarray, samples: np.ndarray, model: TextureModel) -> np.ndarray:
    """Evidence (h, w) of one section, from photons and samples of its blocks (h, w)."""
    h, w = photons.shape
    step = 1 << model.octaves
    margin = (0, -h % step), (0, -w % step)
    levels = [(np.pad(photons, margin), np.pad(samples, margin))]
    for _ in range(model.octaves):
        levels.append((_reduced(levels[-1][0]), _reduced(levels[-1][1])))
    rates = [photons / np.maximum(samples, LEAST_SAMPLES) for photons, samples in levels]
    evidence, around = np.zeros_like(rates[-1]), np.maximum(rates[-1], LEAST_RATE)
    for octave in reversed(range(model.octaves)):
        around = expanded(around)
        band = rates[octave] - expanded(rates[octave + 1])
        noise = _energy(octave) * around / np.maximum(levels[octave][1], LEAST_SAMPLES)
        blur = noise + (model.averaging_error * around) ** 2
        texture = (model.contrast * around) ** 2
        ratio, excess = texture / blur, band * band / (blur + texture)
        excess = excess * (model.saturation / (model.saturation + excess))
        nats = np.where(levels[octave][1] > 0, (ratio * excess - np.log1p(ratio)) / 2, 0)
        # A coefficient of the next coarser octave stands for four of this one.
        evidence = nats + expanded(evidence) / 4
    return evidence[:h, :w]


LEAST_SAMPLES, LEAST_RATE = 1e-3, 1e-12
"""What is divided by where there are no samples, or no light."""


def _reduced(values: np.ndarray) -> np.ndarray:
    """Half the size in both axes, which are even, smoothed by weights 1, 3, 3, 1; zero beyond the borders."""
    return _reduced_rows(_reduced_rows(values).T).T


def expanded(values: np.ndarray) -> np.ndarray:
    """Twice the size in both axes, interpolated between centres; continued beyond the borders."""
    return _expanded_rows(_expanded_rows(values).T).T


def _reduced_rows(values: np.ndarray) -> np.ndarray:
    padded = np.pad(values, ((1, 1), (0, 0)))
    return (3 * (padded[1:-2:2] + padded[2:-1:2]) + (padded[0:-3:2] + padded[3::2])) / 8


def _expanded_rows(values: np.ndarray) -> np.ndarray:
    padded = np.pad(values, ((1, 1), (0, 0)), mode="edge")
    sides = np.stack([padded[:-2], padded[2:]], axis=1)
    return ((3 * values[:, None] + sides) / 4).reshape(2 * values.shape[0], -1)


@cache
def _energy(octave: int) -> float:
    """Sum of the squared weights with which blocks enter a coefficient of an octave.

    Both terms of the coefficient are products of weights by row and by column.
    """
    own = np.eye(16 << octave)
    for _ in range(octave):
        own = _reduced_rows(own)
    middle = own.shape[0] // 2
    a, b = own[middle], _expanded_rows(_reduced_rows(own))[middle]
    return float((a @ a) ** 2 + (b @ b) ** 2 - 2 * (a @ b) ** 2)

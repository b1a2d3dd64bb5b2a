"""Textures of sheets: how bright blocks are, from the photons that reach them, in windows as wide as needed.

A texture in narrow windows is noise, in wide ones it is blurred, and which is better differs from place to
place. So there are windows of several widths, and those that predict the photons around best count most, each
photon predicted by the others (the likelihood of leave-one-out).
"""

import numpy as np

from pcii.base import block_sums, compiled
from pcii.depth.sheets import SheetModel
from pcii.evidence import doubled, gaussian_mean, gaussian_weights

LEAST_LEFT = np.float32(0.05)
"""Share of a texture that is left of it without the photon that it is to predict."""


def textures(
    photons: np.ndarray,
    exposure: np.ndarray,
    mask: np.ndarray,
    mean: np.ndarray,
    samples: np.ndarray,
    model: SheetModel,
) -> tuple[np.ndarray, np.ndarray]:
    """The texture (Q, h, w) of a sheet in photons per sample, and the share (Q, h, w) of each photon in it.

    `photons` (Q, h, w) reach each block and `exposure` (h, w) views do; `mask` (h, w), of which each view has
    `samples` (Q,) in a block; `mean` (Q,) is the brightness of all.
    """
    weight = np.maximum(mask, np.float32(model.least_weight))
    weighted = np.concatenate([photons * weight, (exposure * weight)[None]])
    Q, h, w = photons.shape
    rate, share = np.empty((model.octaves, Q, h, w), np.float32), np.empty((model.octaves, h, w), np.float32)
    nats = np.empty((model.octaves, h, w), np.float32)
    levels = _levels(weighted, mean, samples, model)
    for octave, level in enumerate(levels):
        rate[octave], share[octave] = level[:Q], level[Q] * weight
        block_nats = _level_likelihoods(weighted, rate[octave], share[octave], samples)
        nats[octave] = gaussian_mean(block_nats, gaussian_weights(model.window_blocks, 3))
    nats *= np.float32(2 * np.pi * model.window_blocks**2)
    return _mix_levels(nats, rate, share, samples)


def smooth_texture(
    photons: np.ndarray, exposure: np.ndarray, mean: np.ndarray, samples: np.ndarray, model: SheetModel
) -> np.ndarray:
    """The texture (Q, h, w) in the widest windows alone."""
    sums = np.concatenate([photons, exposure[None]])
    return _levels(sums, mean, samples, model, model.octaves - 1)[0][:-1]


def _levels(
    sums: np.ndarray, mean: np.ndarray, samples: np.ndarray, model: SheetModel, first: int = 0
) -> list[np.ndarray]:
    """Of each octave from the first the textures and the share of a photon at its own block, (Q + 1, h, w).

    Octaves have blocks twice as large as the one before.
    """
    levels, least = list[np.ndarray](), np.float32(model.least)
    shapes = list[tuple[int, ...]]()
    for octave in range(model.octaves):
        if octave > 0:
            sums = block_sums(sums, 2, np.float32) / 4
        shapes.append(sums.shape)
        if octave < first:
            continue
        smooth = np.stack([gaussian_mean(part, gaussian_weights(1.0, 3)) for part in sums])
        exposure = smooth[-1] + least
        # Light is bounded from below, so that no photon is impossible.
        rate = (smooth[:-1] / samples[:, None, None] + least * mean[:, None, None]) / exposure
        photon_share = np.float32(1 / (2 * np.pi * 4**octave)) / exposure
        level = np.concatenate([np.maximum(rate, least * mean[:, None, None]), photon_share[None]])
        for shape in reversed(shapes[:-1]):
            level = doubled(level, shape[1], shape[2])
        levels.append(level)
    return levels


@compiled
def _level_likelihoods(
    sums: np.ndarray, rate: np.ndarray, share: np.ndarray, samples: np.ndarray
) -> np.ndarray:
    """The log-likelihood (h, w) of the photons of each block, each predicted by the others.

    `sums` (Q + 1, h, w) are weighted photons and exposures, `rate` (Q, h, w) a texture, `share` (h, w) the
    share of one photon in it times the samples (Q,).
    """
    Q, h, w = rate.shape
    nats = np.zeros((h, w), np.float32)
    for i in range(h):
        for j in range(w):
            for q in range(Q):
                texture = rate[q, i, j]
                nats[i, j] -= sums[Q, i, j] * samples[q] * texture
                if sums[q, i, j] > 0:
                    others = max(texture - share[i, j] / samples[q], texture * LEAST_LEFT)
                    nats[i, j] += sums[q, i, j] * np.log(others)
    return nats


@compiled
def _mix_levels(
    nats: np.ndarray, rate: np.ndarray, share: np.ndarray, samples: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Means of textures (K, Q, h, w), and of shares (K, h, w), by how likely (K, h, w) each is: (Q, h, w)."""
    K, Q, h, w = rate.shape
    texture, photon_share = np.zeros((Q, h, w), np.float32), np.zeros((Q, h, w), np.float32)
    weight = np.empty(K, np.float32)
    for i in range(h):
        for j in range(w):
            most, total = nats[0, i, j], np.float32(0)
            for k in range(1, K):
                most = max(most, nats[k, i, j])
            for k in range(K):
                weight[k] = np.exp(nats[k, i, j] - most)
                total += weight[k]
            for k in range(K):
                for q in range(Q):
                    texture[q, i, j] += weight[k] / total * rate[k, q, i, j]
                    photon_share[q, i, j] += weight[k] / total * share[k, i, j] / samples[q]
    return texture, photon_share

"""The posterior probability of depth of a piecewise smooth surface.

The depth of a block of pixels is one of Z planes of evenly spaced total disparity. From a block to the next

    T(z' | z) = (1 - q) (1 - s) / (1 + s) s^|z' - z|  +  q / Z:

it moves by a few planes, or, at an outline or a fold, with the probability q to any. With the likelihoods
exp(e_x(z)), e_x the evidence of block x, and T along the edges of a tree that reaches all blocks, the
posterior of a block is exact and takes two messages for each edge (Pearl 1988). Each block is the middle of
two trees (Bleyer and Gelautz 2008): its column, from which all rows branch off, and its row, from which all
columns do. They share their messages, so that eight passes over the film serve all blocks. The posterior is
the mean of that on either tree.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class SurfacePrior:
    """Constants of the prior, for planes of 1 px of total disparity and blocks of 2 px."""

    fall: float = 0.05
    """s: of the probability, from a plane to the next."""
    jump: float = 0.1
    """q: outlines are rare, but rows decide on them one by one, and evidence of neighbours is not independent
    of each other."""


LEAST = 1e-30
"""Least likelihood and probability relative to the largest: all below 69 nats are alike."""


def surface_posterior(nats: np.ndarray, prior: SurfacePrior) -> np.ndarray:
    """Posterior probabilities (h, w, Z) float32 of the planes, from evidence (Z, h, w) in nats."""
    from pcii.depth.chain_kernels import chain_posteriors

    def along_rows(likelihood: np.ndarray) -> np.ndarray:
        posterior = np.empty(likelihood.shape, np.float32)
        chain_posteriors(posterior, np.ascontiguousarray(likelihood), prior.fall, prior.jump, LEAST)
        return posterior

    def along_columns(likelihood: np.ndarray) -> np.ndarray:
        return along_rows(likelihood.swapaxes(0, 1)).swapaxes(0, 1)

    likelihood = np.maximum(np.exp(nats - nats.max(axis=0)), np.float32(LEAST)).transpose(1, 2, 0)
    posterior = _normalised(along_columns(along_rows(likelihood)))
    posterior += _normalised(along_rows(along_columns(likelihood)))
    posterior /= 2
    return posterior


def _normalised(weights: np.ndarray) -> np.ndarray:
    return weights / weights.sum(axis=-1, keepdims=True)

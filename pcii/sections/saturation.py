"""What frames of few bits miss: the share of the photons that saturation removed, estimated from the counts.

Photons that meet in a pixel and a frame are counted as 2^bits - 1 at most. How often they meet follows from
how many there are in the same small part of a view. Of one bit, N of M pixels and frames that are set stand
for M (H_M - H_(M-N)) photons, H being harmonic numbers. For N ~ Binomial(M, p) that is the sum over r of the
unbiased estimates of p^r / r, the series of -ln(1 - p); a lone photon, which says nothing about saturation,
stands for one.
"""

import warnings

import numpy as np

from pcii.core.bayer import colour_index
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.photon_events import NEGLIGIBLE_LOSS, Readout

BLOCK_PX = 8
"""Light is taken as even over blocks of so many pixels to a side, colour by colour: larger ones would average
bright spots away, smaller ones hardly ever hold two photons (docs/single_photon.md has other sizes)."""


def saturation_loss(counts: PhotonCounts) -> float:
    """Share of the photons that the frames of these counts did not hold, from 0 to 1, estimated.

    0 for counts without a limit, and without photons.
    """
    grid, most = counts.grid, counts.readout.most_per_frame
    if most is None or not counts.total:
        return 0.0
    across, down, colours = -(-grid.width // BLOCK_PX), -(-grid.height // BLOCK_PX), counts.channel_count
    rows, cols = np.indices(grid.shape_HW) // BLOCK_PX
    block = ((rows * across + cols) * colours + colour_index(*grid.shape_HW, counts.cfa)).ravel()
    trials = np.bincount(block, minlength=down * across * colours) * float(counts.readout.frames)
    arrived = 0.0
    for number in range(grid.view_count):
        if counts.is_sparse:  # whole images of few photons would take ten times as long
            events, own = counts.events, slice(*counts.view_starts[number : number + 2])
            of, n = block[events.i[own].astype(np.int64) * grid.width + events.j[own]], events.n[own]
        else:
            of, n = block, counts.view(*divmod(number, grid.cols)).ravel()
        counted = np.bincount(of, n, minlength=trials.size)
        lit = counted > 0
        arrived += float(_photons(counted[lit], trials[lit], counts.readout).sum())
    return max(0.0, 1 - counts.total / arrived)


def warn_of_saturation(data: PhotonCounts | Views) -> None:
    """Warn where saturation removed more photons than a model of Poisson counts can do without."""
    loss = 0.0 if isinstance(data, Views) else saturation_loss(data)
    if loss > NEGLIGIBLE_LOSS:
        warnings.warn(
            f"saturation removed about {loss:.0%} of the photons, and depth and removal, which take counts "
            f"for Poisson numbers, are meant for {NEGLIGIBLE_LOSS:.0%} at most; more frames or less light "
            "would keep them",
            UserWarning,
            stacklevel=3,
        )


def _photons(counted: np.ndarray, trials: np.ndarray, readout: Readout) -> np.ndarray:
    """Photons of blocks (N,) that have so many counts in so many pixels and frames."""
    from scipy.special import digamma

    if readout.bits == 1:
        return trials * (digamma(trials + 1) - digamma(trials - counted + 1))
    assert readout.most_per_frame is not None
    # Three photons or more have to meet, and a few in a block say next to nothing about that.
    below = np.minimum(counted, readout.most_per_frame * trials - 0.5)
    return trials * Readout(1, readout.bits).photons(below, trials)

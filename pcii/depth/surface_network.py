"""The posterior probability of depth by a network that has seen many surfaces (docs/theory.md).

A likelihood says at which depth a block shows texture; that a plain ball bulges between its outlines, that
an outline belongs to the nearer side, and that blur around bright things is no surface, is learned. The
network's weights are in `weights`, with a card that says what it has seen; `training` makes them. It runs by
ONNX Runtime.
"""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pcii.base import each_in_threads, threads
from pcii.depth.network_inputs import NETWORK_CELL_BLOCKS, NetworkInputs

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

WEIGHTS = Path(__file__).parent / "weights" / "2026-12"
MULTIPLE = 32
"""Blocks of a cell of the network's coarsest level, of which films are whole numbers."""
TEMPERATURE = 1.5
"""Of the planes given that there is a surface: with it the confidence is right on average, of scenes that the
network was not trained on (docs/experiments/depth.md; temperature scaling, Guo et al. 2017)."""
BAND_VALUES = 1 << 20
"""Blocks times planes whose last step is done at once by a thread, which takes 0.2 GB."""

FOCUS_PLANES = 10.0
"""What is farther from a requested plane has a blur half-extent above 2.5 blocks, and is defocused as far as
its depth says."""
REQUESTED_GAIN, REQUESTED_SIGMA = 2.0, 2.0
"""A surface at a requested plane is `1 + REQUESTED_GAIN` times as probable as one elsewhere, about it with a
standard deviation in planes. With a larger gain or a smaller deviation depth is better in little
light, and worse where objects are at planes that nobody requested (docs/experiments/depth.md)."""
MIN_NEAR = 1e-3
"""Added to the probabilities of depths near a plane: shapes may still show what the depth excludes."""


class NetworkOutputs(NamedTuple):
    """Probabilities, float32, of blocks: of each plane (Z, h, w), of no surface (h, w), and of being in focus
    at each requested plane (R, h, w)."""

    probability: np.ndarray
    no_surface: np.ndarray
    in_focus: np.ndarray


def run_network(inputs: NetworkInputs, requested_planes: np.ndarray) -> NetworkOutputs:
    """What the network says of the blocks of the inputs.

    `requested_planes` (R,) are the positions of the requested planes among those of the inputs: 0 is the
    first, 1.5 lies between the second and the third. `inputs.hint` holds the same request.
    """
    import onnxruntime

    trunk, head = _sessions(WEIGHTS, threads())
    options = onnxruntime.RunOptions()
    # Else the memory of the widest step is kept as long as the process runs.
    options.add_run_config_entry("memory.enable_memory_arena_shrinkage", "cpu:0")
    Z, h, w = inputs.evidence.shape
    # The network takes several films at once; here it is one.
    batch = {name: part[None] for name, part in inputs._asdict().items()}
    *cells, cell_nothing = map(np.asarray, trunk.run(None, batch, options))
    nothing = cell_nothing[0, 0].repeat(NETWORK_CELL_BLOCKS, axis=0).repeat(NETWORK_CELL_BLOCKS, axis=1)
    probability, none = np.empty((Z, h, w), np.float32), np.empty((h, w), np.float32)
    in_focus = np.empty((requested_planes.size, h, w), np.float32)
    weights = requested_weights(Z, requested_planes)
    blocks = batch["evidence"], batch["brightness"]
    rows = max(1, BAND_VALUES // (Z * w)) * NETWORK_CELL_BLOCKS

    def run_band(top: int, options: Any = None) -> None:
        band = slice(top, min(top + rows, h))
        logit, mask = _run_head(head, cells, blocks, band, options)
        none[band], relative = _nothing_and_planes(logit, nothing[band])
        some = 1 - none[band]
        probability[:, band] = _tempered(logit, weights[-1], some)
        in_focus[:, band] = _focus(relative, some, _at_requested(mask, requested_planes), weights)

    *others, last = range(0, h, rows)
    each_in_threads(run_band, others)
    run_band(last, options)
    return NetworkOutputs(probability, none, in_focus)


def _run_head(
    head: "InferenceSession",
    cells: Sequence[np.ndarray],
    blocks: Sequence[np.ndarray],
    band: slice,
    options: Any,
) -> tuple[np.ndarray, np.ndarray]:
    """The logits of planes and of masks at planes, (Z, rows, w), of a band of rows of blocks.

    The head is given the trunk's `cells`, and the evidence and brightness of `blocks`.
    """
    # A convolution of the head reaches one block beyond, so that one cell more is given on either side.
    side = NETWORK_CELL_BLOCKS
    first, last = max(band.start - side, 0), min(band.stop + side, blocks[0].shape[2])
    parts = [part[:, :, first // side : last // side] for part in cells]
    parts += [part[:, :, first:last] for part in blocks]
    names = [argument.name for argument in head.get_inputs()]
    outputs = head.run(["logit", "mask"], dict(zip(names, parts, strict=True)), options)
    logit, mask = (np.asarray(part)[0, :, band.start - first : band.stop - first] for part in outputs)
    return logit, mask


def _nothing_and_planes(logit: np.ndarray, nothing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The probability (rows, w) of no surface, and those of planes (Z, rows, w) relative to the largest."""
    from scipy.special import expit

    largest = logit.max(axis=0)
    relative = np.exp(logit - largest)
    return expit(nothing - largest - np.log(relative.sum(axis=0))), relative


def _tempered(logit: np.ndarray, prior: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Probabilities (Z, rows, w) of planes, whose sum is `some` (rows, w), with a prior (Z,) of each."""
    tempered = logit - logit.max(axis=0)
    tempered /= np.float32(TEMPERATURE)
    np.exp(tempered, out=tempered)
    tempered *= prior[:, None, None]
    return np.multiply(tempered, some / tempered.sum(axis=0), out=tempered)


def _at_requested(mask: np.ndarray, requested_planes: np.ndarray) -> np.ndarray:
    """Values (R, rows, w) of a mask (Z, rows, w) at requested planes, which may lie between two."""
    Z = len(mask)
    lower = np.clip(requested_planes.astype(int), 0, max(Z - 2, 0))
    share = np.clip(requested_planes - lower, 0, 1).astype(np.float32)[:, None, None]
    return (1 - share) * mask[lower] + share * mask[np.minimum(lower + 1, Z - 1)]


def _focus(relative: np.ndarray, some: np.ndarray, mask: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Probabilities (R, rows, w) of being in focus at each requested plane, by depth and by `mask`.

    `relative` (Z, rows, w) are the probabilities of planes, `some` (rows, w) that there is a surface, and
    `weights` those of `requested_weights`.
    """
    from scipy.special import softmax

    *near, total = np.tensordot(weights, relative, axes=1)
    near = np.reshape(near, (-1, *some.shape)) * (some / total)
    elsewhere = np.maximum(1 - near.sum(axis=0, keepdims=True), 0)
    logits = np.concatenate([mask + np.log(near + MIN_NEAR), np.log(elsewhere + MIN_NEAR)])
    return softmax(logits, axis=0)[:-1]


def requested_weights(Z: int, requested_planes: np.ndarray) -> np.ndarray:
    """Weights (R + 1, Z) float32 of the probabilities of planes without a request; NaN requests nothing.

    The last row is how probable a surface at each plane is without any photon, relative to planes that nobody
    requests: the request says that objects are near these planes. Its weighted sum is that of all planes with
    the request, and each other row's, divided by it, is how probable a surface near a requested plane is. A
    plane is near the closest requested one, if within `FOCUS_PLANES`.
    """
    offset = np.arange(Z) - requested_planes[:, None]
    bumps = np.exp(-((offset / REQUESTED_SIGMA) ** 2) / 2)
    prior = (1 + REQUESTED_GAIN * np.nansum(bumps, axis=0)).astype(np.float32)[None]
    if requested_planes.size == 0:
        return prior
    distance = np.abs(np.nan_to_num(offset, nan=np.inf))
    is_closest = distance.argmin(axis=0) == np.arange(requested_planes.size)[:, None]
    is_near = is_closest & (distance <= FOCUS_PLANES)
    return np.concatenate([is_near * prior, prior])


@cache
def _sessions(weights: Path, threads: int) -> "tuple[InferenceSession, InferenceSession]":
    """The network up to cells of 4 px, on a number of threads, and its last step, on the caller's thread."""
    import onnxruntime

    def session(name: str, threads: int) -> "InferenceSession":
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        # Threads that wait by spinning would take the cores of other processes.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        return onnxruntime.InferenceSession(
            weights / f"{name}.onnx", options, providers=["CPUExecutionProvider"]
        )

    return session("trunk", threads), session("head", 1)

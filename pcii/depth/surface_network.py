"""The posterior probability of depth by a network that has seen many surfaces (docs/theory.md).

A likelihood says at which depth a block shows texture; that a plain ball bulges between its outlines, that
an outline belongs to the nearer side, and that blur around bright things is no surface, is learned. The
network's weights are in `weights`; `training` has the commands that make them. It runs by ONNX Runtime.
"""

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pcii.depth.network_inputs import CELL_SIDE_BLOCKS, NetworkInputs

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

WEIGHTS = Path(__file__).parent / "weights"
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
    from scipy.special import expit, softmax

    from pcii.base.compiled_loops import each_in_threads, threads

    trunk, head = _sessions(threads())
    options = onnxruntime.RunOptions()
    # Else the memory of the widest step is kept as long as the process runs.
    options.add_run_config_entry("memory.enable_memory_arena_shrinkage", "cpu:0")
    Z, h, w = inputs.evidence.shape
    # The network takes several films at once; here it is one.
    batch = {name: part[None] for name, part in inputs._asdict().items()}
    *of_cells, cell_nothing = map(np.asarray, trunk.run(None, batch, options))
    nothing = cell_nothing[0, 0].repeat(CELL_SIDE_BLOCKS, axis=0).repeat(CELL_SIDE_BLOCKS, axis=1)
    probability, none = np.empty((Z, h, w), np.float32), np.empty((h, w), np.float32)
    in_focus = np.empty((requested_planes.size, h, w), np.float32)
    lower = np.clip(requested_planes.astype(int), 0, max(Z - 2, 0))
    upper = np.minimum(lower + 1, Z - 1)
    weights = requested_weights(Z, requested_planes)
    prior = weights[-1, :, None, None]
    upper_share = np.clip(requested_planes - lower, 0, 1).astype(np.float32)[:, None, None]
    names = [argument.name for argument in head.get_inputs()]
    rows = max(1, BAND_VALUES // (Z * w)) * CELL_SIDE_BLOCKS

    def run_head(top: int, options: onnxruntime.RunOptions | None = None) -> None:
        end = min(top + rows, h)
        # A convolution of the head reaches one block beyond, so that one cell more is given on either side.
        first, last = max(top - CELL_SIDE_BLOCKS, 0), min(end + CELL_SIDE_BLOCKS, h)
        cells = np.s_[:, :, first // CELL_SIDE_BLOCKS : last // CELL_SIDE_BLOCKS]
        blocks = np.s_[:, :, first:last]
        parts = *(part[cells] for part in of_cells), batch["evidence"][blocks], batch["brightness"][blocks]
        outputs = head.run(["logit", "mask"], dict(zip(names, parts, strict=True)), options)
        logit, mask = (np.asarray(part)[0, :, top - first : end - first] for part in outputs)
        largest = logit.max(axis=0)
        logit = logit - largest
        weight = np.exp(logit)
        total = weight.sum(axis=0)
        none[top:end] = expit(nothing[top:end] - largest - np.log(total))
        some = 1 - none[top:end]
        logit /= np.float32(TEMPERATURE)
        tempered = np.exp(logit, out=logit)
        tempered *= prior
        np.multiply(tempered, some / tempered.sum(axis=0), out=probability[:, top:end])
        *of_planes, of_all = np.tensordot(weights, weight, axes=1)
        of_planes = np.reshape(of_planes, (-1, *some.shape)) * (some / of_all)
        of_none = np.maximum(1 - of_planes.sum(axis=0, keepdims=True), 0)
        at_planes = (1 - upper_share) * mask[lower] + upper_share * mask[upper]
        logits = np.concatenate([at_planes + np.log(of_planes + MIN_NEAR), np.log(of_none + MIN_NEAR)])
        in_focus[:, top:end] = softmax(logits, axis=0)[:-1]

    *others, last = range(0, h, rows)
    each_in_threads(run_head, others)
    run_head(last, options)
    return NetworkOutputs(probability, none, in_focus)


def depth_prior(Z: int, requested_planes: np.ndarray) -> np.ndarray:
    """How probable a surface at each of Z planes is without any photon, relative to planes that nobody
    requests: (Z,) float32. The request says that objects are near these planes; NaN requests nothing.
    """
    offset = np.arange(Z) - requested_planes[:, None]
    bumps = np.exp(-((offset / REQUESTED_SIGMA) ** 2) / 2)
    return (1 + REQUESTED_GAIN * np.nansum(bumps, axis=0)).astype(np.float32)


def requested_weights(Z: int, requested_planes: np.ndarray) -> np.ndarray:
    """Weights (R + 1, Z) float32 of the probabilities of planes without a request.

    The weighted sum of the last row is that of all planes with the request, and each other row's, divided by
    it, is how probable a surface near a requested plane is. NaN requests nothing.
    """
    prior = depth_prior(Z, requested_planes)
    return np.concatenate([near_requested(Z, requested_planes) * prior, prior[None]])


def near_requested(Z: int, requested_planes: np.ndarray) -> np.ndarray:
    """Which of Z planes are near each requested one: (R, Z) float32, 0 or 1.

    A plane is near the closest requested one, if within `FOCUS_PLANES`; NaN requests nothing.
    """
    if requested_planes.size == 0:
        return np.zeros((0, Z), np.float32)
    distance = np.abs(np.arange(Z) - np.nan_to_num(requested_planes, nan=np.inf)[:, None])
    is_closest = distance.argmin(axis=0) == np.arange(requested_planes.size)[:, None]
    return (is_closest & (distance <= FOCUS_PLANES)).astype(np.float32)


@cache
def _sessions(threads: int) -> "tuple[InferenceSession, InferenceSession]":
    """The network up to cells of 4 px, on a number of threads, and its last step, on the caller's thread."""
    import onnxruntime

    def session(name: str, threads: int) -> "InferenceSession":
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        # Threads that wait by spinning would take the cores of other processes.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        return onnxruntime.InferenceSession(
            WEIGHTS / f"{name}.onnx", options, providers=["CPUExecutionProvider"]
        )

    return session("trunk", threads), session("head", 1)

"""The compiled loop that finds an outline of least length (serial: pictures are small)."""

import math

import numpy as np

from pcii.kernels import helper


@helper
def least_outline(gain: np.ndarray, length_cost: float, iterations: int, inside: np.ndarray) -> None:
    """The mask that gains most, less `length_cost` per px of its outline: relaxed to [0, 1] in `inside`.

    Minimises length_cost TV(u) - sum gain u over 0 <= u <= 1 for a picture (H, W) by the primal-dual steps
    of Chambolle and Pock 2011; thresholding u anywhere gives a best mask (Chan, Esedoglu and Nikolova 2006).
    """
    H, W = gain.shape
    for i in range(H):
        for j in range(W):
            inside[i, j] = 1.0 if gain[i, j] > 0 else 0.0
    across, down = np.zeros((H, W), np.float32), np.zeros((H, W), np.float32)
    shorten_outline(gain, length_cost, iterations, inside, inside.copy(), across, down)


@helper
def shorten_outline(
    gain: np.ndarray,
    length_cost: float,
    iterations: int,
    inside: np.ndarray,
    ahead: np.ndarray,
    across: np.ndarray,
    down: np.ndarray,
) -> None:
    """The same, going on from a state (all (H, W)), which is overwritten: gains may have changed."""
    H, W = gain.shape
    step = 0.35  # 8 step^2 < 1
    for _ in range(iterations):
        for i in range(H):
            for j in range(W):
                x = across[i, j] + (step * (ahead[i, j + 1] - ahead[i, j]) if j + 1 < W else 0.0)
                y = down[i, j] + (step * (ahead[i + 1, j] - ahead[i, j]) if i + 1 < H else 0.0)
                size = max(1.0, math.sqrt(x * x + y * y) / length_cost)
                across[i, j] = x / size
                down[i, j] = y / size
        for i in range(H):
            for j in range(W):
                flow = across[i, j] + down[i, j]
                if j > 0:
                    flow -= across[i, j - 1]
                if i > 0:
                    flow -= down[i - 1, j]
                new = min(max(inside[i, j] + step * (flow + gain[i, j]), 0.0), 1.0)
                ahead[i, j] = 2 * new - inside[i, j]
                inside[i, j] = new

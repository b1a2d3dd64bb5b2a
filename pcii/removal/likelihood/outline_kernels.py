"""The compiled loop that finds an outline of least length (serial: pictures are small)."""

import numpy as np

from pcii.base.compiled_loops import compiled


@compiled
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


@compiled
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
    step = np.float32(0.35)  # 8 step^2 < 1
    dearer = np.float32(1 / length_cost)
    one, zero = np.float32(1), np.float32(0)
    for _ in range(iterations):
        for i in range(H):
            # Slices, so that the compiler sees that neighbours exist and takes several at a time.
            here, below = ahead[i], ahead[min(i + 1, H - 1)]
            beside, right, under = here[1:], across[i], down[i]
            for j in range(beside.size):
                x = right[j] + step * (beside[j] - here[j])
                y = under[j] + step * (below[j] - here[j])
                shrink = one / max(one, np.sqrt(x * x + y * y) * dearer)
                right[j] = x * shrink
                under[j] = y * shrink
            y = under[W - 1] + step * (below[W - 1] - here[W - 1])
            under[W - 1] = y / max(one, abs(y) * dearer)
        for i in range(H):
            own, then, earned, right, under = inside[i], ahead[i], gain[i], across[i], down[i]
            then[0] = right[0] + under[0]
            before = right[:-1]
            later, ending, below = then[1:], right[1:], under[1:]
            for j in range(before.size):
                later[j] = ending[j] + below[j] - before[j]
            if i > 0:
                above = down[i - 1]
                for j in range(then.size):
                    then[j] -= above[j]
            for j in range(then.size):
                new = min(max(own[j] + step * (then[j] + earned[j]), zero), one)
                then[j] = 2 * new - own[j]
                own[j] = new

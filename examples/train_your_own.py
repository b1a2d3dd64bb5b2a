"""A training loop on examples of `pcii.examples`, in NumPy: at which plane is each block of the picture?

    simgen generate small -o out/train --set 'scene=["drawn_cards","drawn_textured","drawn_plain"]' \
        --scenes 20 --set products.radiance=none --set photons.budget=10000
    python examples/train_your_own.py out/train 300

makes 60 datasets, and trains for 300 seconds on the scenes of the training part. On scenes that it has not
seen it prints how often its likeliest plane is right, and how often that of the greatest evidence. Without
arguments it is a short run on scenes that it makes. Put a network of yours in the place of `features` and
`weights`: PyTorch's DataLoader takes the examples as they are.
"""

import sys
import time
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.special import softmax

import pcii
import simgen

WIDTHS = (1, 3, 7, 15, 31)
"""Sides of the windows in blocks, over which evidence is added up."""
RATE, MEMORY = 0.02, 0.99
"""Size of a step, and how much of the mean square of the gradient is kept (RMSProp)."""


def smoothed(values: np.ndarray, side: int) -> np.ndarray:
    """Means (Z, h, w) of windows of `side` x `side` blocks."""
    return uniform_filter1d(uniform_filter1d(values, side, axis=1), side, axis=2)


def features(example: dict[str, np.ndarray]) -> np.ndarray:
    """Evidence in windows and brightness of each plane, (F, Z, h, w); each also times the amount of light."""
    light = smoothed(example["sections"].mean(axis=1), 2)[:, ::2, ::2]
    parts = [np.arcsinh(width**2 * smoothed(example["evidence"], width)) for width in WIDTHS]
    parts.append(np.sqrt(light / max(light.mean(), 1e-9)))
    stack = np.stack(parts)
    stack = np.concatenate([stack, stack - uniform_filter1d(stack, 5, axis=1)])  # sharper than planes around
    return np.concatenate([stack, stack * (np.log10(light.mean() + 1e-9) + 2)])


def train(examples: pcii.Examples, seconds: float) -> np.ndarray:
    """Weights (F,) of a softmax over the planes, by descent of its log loss for some seconds."""
    rng, begin, square = np.random.default_rng(0), time.monotonic(), 0.0
    weights, losses = np.zeros(0), []
    while time.monotonic() - begin < seconds:
        example = examples[int(rng.integers(len(examples)))]
        inputs, true = features(example), example["plane"][::2, ::2]
        rows, cols = np.nonzero(true >= 0)
        if not rows.size:
            continue
        weights = weights if weights.size else np.zeros(len(inputs))
        inputs, true = inputs[:, :, rows, cols], true[rows, cols]
        chance = softmax(np.tensordot(weights, inputs, 1), axis=0)
        losses.append(-np.log(chance[true, np.arange(true.size)] + 1e-12).mean())
        chance[true, np.arange(true.size)] -= 1
        gradient = np.tensordot(inputs, chance, 2) / true.size
        square = MEMORY * square + (1 - MEMORY) * gradient**2
        weights = weights - RATE * gradient / np.sqrt(square + 1e-8)
        if len(losses) % 100 == 0:
            print(f"{len(losses)} steps: loss {np.mean(losses[-100:]):.2f}")
    return weights


def right_shares(weights: np.ndarray, examples: pcii.Examples) -> np.ndarray:
    """How often the weights have the right plane, and how often the evidence alone has, (2,)."""
    hits = []
    for example in examples:
        true = example["plane"][::2, ::2]
        guesses = np.tensordot(weights, features(example), 1), example["evidence"]
        hits.append([(guess.argmax(axis=0) == true)[true >= 0].mean() for guess in guesses])
    return np.mean(hits, axis=0)


def main(folder: str = "out/training", seconds: float = 2.0) -> None:
    """Train on one part of a collection, and print how right that is on another one."""
    if len(sys.argv) == 1:
        overrides = ["scene=drawn_plain", "products.radiance=none", "photons.budget=10000"]
        simgen.generate_collection("small", folder, [*overrides, "scene_number={range=[7,10]}"])
    options: dict[str, Any] = {"fields": ("sections", "evidence", "truth"), "photons": (100, 10_000)}
    height, width = (min(128, size // 4 * 4) for size in pcii.open_collection(folder)[0].grid.shape_HW)
    training = pcii.examples(folder, split="train", crop_px=(height, width), poses=True, **options)
    unseen = pcii.examples(folder, split="test", seed=0, **options)
    print(f"{len(training)} datasets to learn from, {len(unseen)} that are not seen")
    shares = right_shares(train(training, seconds), unseen)
    print("right planes: {:.3f} by the weights, {:.3f} by evidence alone".format(*shares))


if __name__ == "__main__":
    main(*([sys.argv[1], float(sys.argv[2])] if len(sys.argv) > 2 else []))

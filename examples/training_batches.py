"""Batches of plain arrays for a training loop, from a collection of drawn scenes.

Each example is a small window: photons of all views at their places in the section at one depth, by colour,
and which of its pixels are in focus there. `torch.from_numpy` and `jax.numpy.asarray` take the arrays as
they are.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import pcii
import simgen


def examples(
    collection: pcii.Collection, rng: np.random.Generator
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Photon counts of a section (C, H, W) and what is in focus (H, W) bool, dataset by dataset, shuffled."""
    for number in rng.permutation(len(collection)):
        dataset = collection[int(number)]
        truth, planes = dataset.truth, dataset.analysis["z_mm"]
        assert truth is not None
        plane = pcii.FocalPlanes.at_depths(dataset.grid, rng.choice(planes))
        section = pcii.reconstruct(dataset.counts, plane)
        in_focus = pcii.TrueFocus(plane, truth).by_pixel[0]
        yield np.moveaxis(section.counts[0], -1, 0).astype(np.float32), in_focus


def batches(collection: pcii.Collection, size: int, seed: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Batches (N, C, H, W) and (N, H, W) of one pass over a collection."""
    kept = []
    for example in examples(collection, np.random.default_rng(seed)):
        kept.append(example)
        if len(kept) == size:
            yield np.stack([counts for counts, _ in kept]), np.stack([focus for _, focus in kept])
            kept = []


def main(folder: Path) -> None:
    """Four small scenes, and a pass over their training part: a regression on the photons of 8 x 8 pixels."""
    overrides = ["scene=drawn_plain", "photons.budget=400", "products.radiance=none"]
    collection = simgen.generate_collection("small", folder, overrides, scenes=4)
    print(collection)
    weight, bias = 0.0, 0.0
    training = collection[collection.table()["split"] == "train"]
    for step, (counts, focus) in enumerate(batches(training, size=2, seed=0)):
        n, _, height, width = counts.shape
        cells = counts.sum(axis=1).reshape(n, height // 8, 8, width // 8, 8).sum(axis=(2, 4))
        wanted = focus.reshape(n, height // 8, 8, width // 8, 8).mean(axis=(2, 4))
        inputs = np.log1p(cells)
        said = 1 / (1 + np.exp(-(weight * inputs + bias)))
        loss = -(wanted * np.log(said) + (1 - wanted) * np.log(1 - said)).mean()
        weight -= 0.5 * ((said - wanted) * inputs).mean()
        bias -= 0.5 * (said - wanted).mean()
        print(f"step {step}: {n} examples, loss {loss:.3f}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/training-batches"))

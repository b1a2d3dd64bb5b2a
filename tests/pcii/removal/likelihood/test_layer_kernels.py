"""The rays of opaque layers: who hides what, and what is seen, against loops over single pixels."""

import itertools

import numpy as np
import pytest

from pcii.removal.likelihood import layer_kernels

CELL = 4  # a cell has 4 x 4 px, so that of a view's cell up to 16 px are covered


def moved(cells: np.ndarray, down: int, right: int) -> np.ndarray:
    """Cells (h, w) of what is seen at (i, j) and belongs to (i + down, j + right), pixel by pixel; else 0."""
    pixels = cells.repeat(CELL, axis=0).repeat(CELL, axis=1).astype(np.float64)
    result = np.zeros_like(pixels)
    for i, j in np.ndindex(*pixels.shape):
        if 0 <= i + down < pixels.shape[0] and 0 <= j + right < pixels.shape[1]:
            result[i, j] = pixels[i + down, j + right]
    h, w = cells.shape
    return result.reshape(h, CELL, w, CELL).mean(axis=(1, 3))


def test_who_hides_what_is_counted_as_pixel_by_pixel():
    # Shifts of every remainder, and one by which nothing is seen.
    rng = np.random.default_rng(3)
    V, (h, w), rows, cols = 6, (7, 5), np.array([-11, 2]), np.array([8, 1, -33])
    mask, light = rng.random((h, w)) < 0.5, rng.random((h, w)).astype(np.float32)
    mask[:2] = mask[:, 4] = False
    before = rng.integers(0, 24, (V, h, w)).astype(np.uint16)
    behind = rng.random((V, h, w)).astype(np.float32)
    shifts = list(itertools.product(rows, cols))
    seen = 1 - np.minimum(before / CELL**2, 1)
    views, through = np.ones((2, h, w), np.float32)
    layer_kernels.views_of(before, rows, cols, views)
    layer_kernels.light_of(behind, before, rows, cols, through)
    for total, each in ((views, seen), (through, seen * behind)):
        expected = sum(moved(each[v], -down, -right) for v, (down, right) in enumerate(shifts))
        np.testing.assert_allclose(total, expected, rtol=1e-5, atol=1e-6)
    covered, painted = before.copy(), behind.copy()
    layer_kernels.cover(mask, rows, cols, 1, covered)
    layer_kernels.paint(mask, light, rows, cols, painted)
    for v, (down, right) in enumerate(shifts):
        share = moved(mask, down, right)
        np.testing.assert_array_equal(covered[v], before[v] + CELL**2 * share)
        own = moved(mask * light, down, right)
        np.testing.assert_allclose(painted[v], behind[v] * (1 - share) + own, rtol=1e-5, atol=1e-6)
    layer_kernels.cover(mask, rows, cols, -1, covered)
    np.testing.assert_array_equal(covered, before)
    layer_kernels.cover(np.zeros_like(mask), rows, cols, 1, covered)
    layer_kernels.paint(np.zeros_like(mask), light, rows, cols, painted)
    np.testing.assert_array_equal(covered, before)


@pytest.mark.parametrize("height", [1, 15, 16, 17, 33])
def test_films_of_any_height_are_added_up_in_bands(height):
    rng = np.random.default_rng(7)
    rows, cols = np.array([-37, -2, 0, 5]), np.array([0, 3])
    covered = rng.integers(0, 20, (8, height, 4)).astype(np.uint16)
    views = np.ones((height, 4), np.float32)
    layer_kernels.views_of(covered, rows, cols, views)
    seen = 1 - np.minimum(covered / CELL**2, 1)
    each = [moved(seen[v], -down, -right) for v, (down, right) in enumerate(itertools.product(rows, cols))]
    np.testing.assert_allclose(views, np.sum(each, axis=0), rtol=1e-5, atol=1e-6)


def test_all_light_of_the_views_is_gathered_somewhere():
    rng = np.random.default_rng(3)
    V, (h, w), rows, cols = 6, (7, 5), np.array([-3, 0]), np.array([2, 0, -9])
    behind = rng.random((V, h, w)).astype(np.float32)
    gathered, own = np.zeros((h, w)), np.ones((h, w))
    for v, a, b in itertools.product(range(V), range(h), range(w)):
        at = np.clip(a + rows[v // 3], 0, h - 1), np.clip(b + cols[v % 3], 0, w - 1)
        gathered[at] += behind[v, a, b]
    layer_kernels.gathered(behind, rows, cols, own)
    np.testing.assert_allclose(own, gathered, rtol=1e-5)

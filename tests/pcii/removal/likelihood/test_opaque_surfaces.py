"""Surfaces that hide others, as `pcii.segment` tells them apart: what is before what, and where it ends."""

from typing import NamedTuple

import numpy as np
from twins import blocky_texture, intersection_over_union, opaque_views, photons_of, unit_grid

from pcii import PhotonCounts, segment

GRID = unit_grid(7, 7, 256, 256)


class Seen(NamedTuple):
    """Photons of a scene, the depths of its surfaces from far to near, and what is seen of each (H, W)."""

    counts: PhotonCounts
    z_mm: list[float]
    masks: list[np.ndarray]


def rectangle(top: int, left: int, height: int, width: int) -> np.ndarray:
    mask = np.zeros((GRID.height, GRID.width), dtype=bool)
    mask[top : top + height, left : left + width] = True
    return mask


def agreement(scene: Seen) -> list[float]:
    """Intersection over union of each surface with what is found of it."""
    focus = segment(scene.counts, scene.z_mm, method="likelihood")
    return [intersection_over_union(*pair) for pair in zip(focus.in_focus, scene.masks, strict=True)]


def bar_before_card(per_view: float, seed: int = 0) -> Seen:
    """A plain grey bar, narrower than its parallax, before a card of strong texture; dark around."""
    card = blocky_texture(np.random.default_rng(7), 176, 176, block_px=12)
    surfaces = [(card, 40, 40, 4), (np.full((224, 40, 3), 0.4), 16, 108, 8)]
    bar = rectangle(16, 108, 224, 40)
    counts = photons_of(opaque_views(surfaces, GRID), GRID, per_view, seed=seed)
    return Seen(counts, [1 / 4, 1 / 8], [rectangle(40, 40, 176, 176) & ~bar, bar])


def test_a_bar_is_told_from_the_card_that_cameras_see_past_it():
    # 2 px off all along both sides of the bar, half of a cell of evidence: 36 / 40.
    assert min(agreement(bar_before_card(300))) > 0.9


def card_before_card(per_view: float, seed: int, *, nearer: bool = True) -> Seen:
    """A card of coarse squares before a larger one; without the `nearer` nothing is at its depth."""
    rng = np.random.default_rng(seed)
    places = [(40, 40, 176, 4), (80, 70, 100, 6)][: 1 + nearer]
    surfaces = [
        (blocky_texture(rng, side, side, block_px=40), top, left, disparity)
        for top, left, side, disparity in places
    ]
    counts = photons_of(opaque_views(surfaces, GRID), GRID, per_view, seed=seed)
    near = rectangle(80, 70, 100, 100) & nearer
    return Seen(counts, [1 / 4, 1 / 6], [rectangle(40, 40, 176, 176) & ~near, near])


def test_a_card_is_told_from_the_one_before_it():
    # Where a square of 40 px at the nearer card's border is as dark as the one behind it nothing tells them
    # apart: of the nine squares that it covers all or in part one more or less is a tenth, two are a fifth.
    found = np.mean([agreement(card_before_card(150, seed)) for seed in (1, 2)], axis=0)
    assert min(found) > 0.7


def test_a_piece_that_stands_out_stays_at_its_depth():
    # Told by itself each of its squares saves something, at the depth of the other plane as well.
    scene = card_before_card(300, 1, nearer=False)
    card = scene.masks[0]
    far, near = segment(scene.counts, scene.z_mm, method="likelihood").in_focus
    assert intersection_over_union(far, card) > 0.9
    assert np.count_nonzero(near) < 0.01 * np.count_nonzero(card)


def test_what_is_dim_beside_something_bright_is_not_put_behind_it():
    # A dim square in a bright frame on a larger dim square: all of one picture, at one depth.
    picture = np.full((160, 160, 3), 0.1)
    picture[36:124, 36:124] = 1
    picture[40:120, 40:120] = 0.1
    counts = photons_of(opaque_views([(picture, 48, 48, 8)], GRID), GRID, 100, seed=3)
    far, near = segment(counts, [1 / 4, 1 / 8], method="likelihood").in_focus
    assert intersection_over_union(near, rectangle(48, 48, 160, 160)) > 0.95
    assert not far.any()


def test_what_is_seen_through_a_window_is_behind_it():
    # A frame of texture whose window is as wide as its parallax, before a card of texture.
    rng = np.random.default_rng(3)
    card, frame = (blocky_texture(rng, 160, 160, block_px=12) for _ in range(2))
    frame[48:112, 48:112] = 0
    views = opaque_views([(card, 48, 48, 4), (frame, 48, 48, 8)], GRID)
    window = rectangle(96, 96, 64, 64)
    scene = Seen(
        photons_of(views, GRID, 300, seed=3),
        [1 / 4, 1 / 8],
        [window, rectangle(48, 48, 160, 160) & ~window],
    )
    assert min(agreement(scene)) > 0.7

import itertools
from typing import Any

import numpy as np
import pytest
from twins import bayer_photons, blocky_texture, intersection_over_union, patch_views, unit_grid

from pcii import PhotonCounts, segment
from pcii.core.bayer import sites_of_colours
from pcii.core.geometry import total_disparity_px
from pcii.evidence.cells import CELL_PX
from pcii.evidence.prediction_kernels import BASE_SCALE, land, predict, predict_shared
from pcii.removal.likelihood import guesses, layer_kernels, layer_search, layers
from pcii.removal.likelihood.layer_search import layered
from pcii.removal.likelihood.outline_kernels import least_outline, shorten_outline

GRID = unit_grid(7, 7, 256, 256)
CARD_DISPARITY, BAR_DISPARITY = 4, 8
SPREAD_PX = total_disparity_px(GRID, 1 / np.array([CARD_DISPARITY, BAR_DISPARITY]))
BAR_LEFT, BAR_WIDTH, BAR_TOP, BAR_HEIGHT = 108, 40, 16, 224
CARD_TOP, CARD_LEFT, CARD_SIZE = 40, 40, 176


def truth() -> tuple[np.ndarray, np.ndarray]:
    """What the virtual centre sees of the card and of the bar, (H, W) each."""
    card, bar = np.zeros((2, GRID.height, GRID.width), dtype=bool)
    bar[BAR_TOP : BAR_TOP + BAR_HEIGHT, BAR_LEFT : BAR_LEFT + BAR_WIDTH] = True
    card[CARD_TOP : CARD_TOP + CARD_SIZE, CARD_LEFT : CARD_LEFT + CARD_SIZE] = True
    return card & ~bar, bar


def bar_before_card(per_view: float, seed: int = 0) -> PhotonCounts:
    """A plain grey bar, narrower than its parallax, before a card of strong texture; dark around."""
    texture = blocky_texture(np.random.default_rng(7), CARD_SIZE, CARD_SIZE, block_px=12)
    card = patch_views(texture, CARD_TOP, CARD_LEFT, CARD_DISPARITY, GRID)
    grey = np.full((BAR_HEIGHT, BAR_WIDTH, 3), 0.4)
    bar = patch_views(grey, BAR_TOP, BAR_LEFT, BAR_DISPARITY, GRID)
    rates = np.where(bar > 0, bar, card) + 0.002
    rates *= 3 * per_view * GRID.view_count / rates.sum()  # a pixel sees one colour of three
    return PhotonCounts.from_dense(bayer_photons(rates, "GRBG", seed), GRID, cfa="GRBG")


def cells_of(mask: np.ndarray) -> np.ndarray:
    return mask[CELL_PX // 2 :: CELL_PX, CELL_PX // 2 :: CELL_PX]


def everything_at_the_card() -> np.ndarray:
    card, bar = truth()
    return np.where(cells_of(card | bar), 0, -1)


def found(per_view: float) -> list[float]:
    seen = layered(bar_before_card(per_view), SPREAD_PX, [everything_at_the_card()])
    return [intersection_over_union(seen == layer, cells_of(mask)) for layer, mask in enumerate(truth())]


def test_a_bar_is_told_from_the_card_that_cameras_see_past_it():
    # An eighth of the card is dark in all colours: paint, or nothing there? The bar is 10 cells wide, and of
    # each cell along its sides it may be told or not.
    card, bar = found(2000)
    assert card > 1 - 1 / 8
    assert bar > 0.9


def test_rays_that_are_blocked_must_not_be_believed(monkeypatch: pytest.MonkeyPatch):
    # The planted fault: light of the bar counts as the card's, and the bar's as the card behind it.
    monkeypatch.setattr(layers, "BLOCKED_WEIGHT", 1.0)
    card, bar = found(2000)
    assert card < 0.7
    assert bar < 0.98


def test_the_method_finds_both():
    z_mm = [1 / CARD_DISPARITY, 1 / BAR_DISPARITY]
    focus = segment(bar_before_card(2000), z_mm, method="likelihood")
    # A pixel off all along both sides of the bar: 2 / 41; of the card there are as many again.
    for mask, own in zip(focus.in_focus, truth(), strict=True):
        assert intersection_over_union(mask, own) > 0.92


def test_the_start_of_least_energy_is_followed(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(layer_search, "ROUNDS", 0)
    counts = bar_before_card(2000)
    good, bad = np.where(cells_of(truth()[1]), 1, everything_at_the_card()), everything_at_the_bar()
    results = {order: layered(counts, SPREAD_PX, order_of) for order, order_of in starts(good, bad)}
    np.testing.assert_array_equal(results["good, bad"], results["bad, good"])
    np.testing.assert_array_equal(results["good, bad"], results["good"])


def everything_at_the_bar() -> np.ndarray:
    """What is true in part, and hides the card."""
    return np.where(everything_at_the_card() >= 0, 1, -1)


def starts(good: np.ndarray, bad: np.ndarray) -> list[tuple[str, list[np.ndarray]]]:
    return [("good, bad", [good, bad]), ("bad, good", [bad, good]), ("good", [good, good])]


def card_before_card(
    per_view: float, seed: int = 1, *, nearer: bool = True
) -> tuple[PhotonCounts, np.ndarray, np.ndarray]:
    """Two cards of coarse texture one before the other, their spreads in px, and what is seen (h, w).

    Without the `nearer` nothing is at its depth.
    """
    disparities, rng = np.array([4, 6]), np.random.default_rng(seed)
    views, seen = np.zeros((*GRID.shape_KLHW, 3)), np.full((64, 64), -1)
    for layer, (top, left, size) in enumerate([(40, 40, 176), (80, 70, 100)][: 1 + nearer]):
        texture = blocky_texture(rng, size, size, block_px=40)
        own = patch_views(texture, top, left, int(disparities[layer]), GRID)
        views = np.where(own > 0, own, views)
        rows, cols = (slice((at + 2) // CELL_PX, (at + size + 2) // CELL_PX) for at in (top, left))
        seen[rows, cols] = layer
    rates = views + 0.002
    rates *= 3 * per_view * GRID.view_count / rates.sum()
    counts = PhotonCounts.from_dense(bayer_photons(rates, "GRBG", seed), GRID, cfa="GRBG")
    return counts, total_disparity_px(GRID, 1 / disparities), seen


def test_guesses_lead_out_of_a_valley(monkeypatch: pytest.MonkeyPatch):
    counts, spread_px, truth = card_before_card(500)
    everything_near = [np.where(truth >= 0, 1, -1)]

    def agreement() -> list[float]:
        found = layered(counts, spread_px, everything_near)
        return [intersection_over_union(found == layer, truth == layer) for layer in (0, 1)]

    assert min(agreement()) > 0.75
    # Without guesses the wrong start stays what it is.
    monkeypatch.setattr(layer_search, "ROUNDS", 0)
    assert max(agreement()) < 0.7


def test_a_piece_that_stands_out_stays_at_its_depth(monkeypatch: pytest.MonkeyPatch):
    # A card of coarse squares: told by itself each saves something, at the depth of the other plane as well.
    counts, spread_px, card = card_before_card(1000, nearer=False)
    moved = layered(counts, spread_px, [card]) == 1
    assert np.count_nonzero(moved) < 0.01 * np.count_nonzero(card >= 0)
    compared = layer_search._told_by_itself

    def without_the_same_piece(
        doubled: layers.Layers, masks: np.ndarray, piece: np.ndarray
    ) -> list[np.ndarray]:
        return compared(doubled, masks, np.zeros_like(piece) if piece[0].any() else piece)

    monkeypatch.setattr(layer_search, "_told_by_itself", without_the_same_piece)
    moved = layered(counts, spread_px, [card]) == 1
    assert np.count_nonzero(moved) > 0.2 * np.count_nonzero(card >= 0)


def test_what_is_told_by_itself_at_its_own_layer_leaves_no_seam():
    # Light that is the same everywhere is told by a part of it as by all: a seam would let the dark through.
    counts = PhotonCounts.from_dense(np.full(GRID.shape_KLHW, 1), GRID, cfa=None)
    doubled = layers.Layers(counts, np.repeat(SPREAD_PX, 2), (1e-3, 1e-2))
    masks, piece = np.zeros((2, 2, 64, 64), dtype=bool)
    masks[0, 8:-8, 8:-8] = True
    piece[0, 24:40, 24:40] = True
    whole = layer_search._explained(doubled, masks)
    for apart in layer_search._told_by_itself(doubled, masks, piece):
        # A piece alone has less light to be told of, which costs a little; through a seam of 64 cells, where
        # each of 49 views expects a quarter of 16 photons less, thousands of nats would be gained.
        assert abs((apart - whole).sum()) < 20


def test_what_is_told_by_itself_leaves_hardly_a_seam_where_shifts_are_no_whole_cells():
    counts = PhotonCounts.from_dense(np.full(GRID.shape_KLHW, 1), GRID, cfa=None)
    spread_px = total_disparity_px(GRID, 1 / np.array([4, 6]))
    doubled = layers.Layers(counts, np.repeat(spread_px, 2), (1e-3, 1e-2))
    masks, piece = np.zeros((2, 2, 64, 64), dtype=bool)
    masks[1, 8:-8, 8:-8] = True
    piece[1, 24:40, 24:40] = True
    whole = layer_search._explained(doubled, masks)
    cut = layer_search._explained_in_pairs(doubled, piece, masks & ~piece)
    seam = (cut - whole).sum()
    assert seam > 5000
    for apart in layer_search._told_by_itself(doubled, masks, piece):
        assert abs((apart - whole).sum()) < seam / 5


def test_what_lies_beside_something_bright_is_told_best_from_behind_it():
    # A dim square in a bright frame, and a piece that is larger than it by a cell. In front of the frame the
    # frame's light tells some of the piece's, behind it none. Else that would speak for any depth behind.
    picture = np.full((160, 160, 3), 0.1)
    picture[36:124, 36:124] = 1
    picture[40:120, 40:120] = 0.1
    views = patch_views(picture, 48, 48, BAR_DISPARITY, GRID) + 0.002
    rates = 100 * 3 * views * GRID.view_count / views.sum()
    counts = PhotonCounts.from_dense(bayer_photons(rates, "GRBG", 3), GRID, cfa="GRBG")
    doubled = layers.Layers(counts, np.repeat(SPREAD_PX, 2), (1e-5, 1e-4))
    masks, piece = np.zeros((2, 2, 64, 64), dtype=bool)
    masks[1, 12:52, 12:52] = True
    piece[1, 21:43, 21:43] = True
    front, behind = (told.sum() for told in layer_search._told_by_itself(doubled, masks, piece))
    assert behind > front + 50


def test_a_piece_that_is_told_better_from_behind_its_layer_stays(monkeypatch: pytest.MonkeyPatch):
    counts, spread_px, truth = card_before_card(500)
    everything_near = [np.where(truth >= 0, 1, -1)]
    told, bonus = layer_search._told_by_itself, itertools.cycle([1e3, 0])

    def as_it_was_from_behind(
        doubled: layers.Layers, masks: np.ndarray, piece: np.ndarray
    ) -> list[np.ndarray]:
        front, behind = told(doubled, masks, piece)
        return [front, behind + next(bonus)]  # first where the piece was, then where it is

    by_guesses = layered(counts, spread_px, everything_near)
    monkeypatch.setattr(layer_search, "_told_by_itself", as_it_was_from_behind)
    none_kept = layered(counts, spread_px, everything_near)
    monkeypatch.setattr(layer_search, "guesses_of", lambda layers: ())
    without = layered(counts, spread_px, everything_near)
    np.testing.assert_array_equal(none_kept, without)
    assert np.count_nonzero(by_guesses != without) > 500


class Still:
    """Layers that are as they were put: two of 20 x 20 cells, of which the nearer is empty at first."""

    def __init__(self) -> None:
        self.masks = np.zeros((2, 20, 20), dtype=bool)
        self.masks[0] = True

    def put(self, masks: np.ndarray) -> None:
        self.masks = masks.copy()

    def visible(self) -> np.ndarray:
        return np.where(self.masks[1], 1, 0)

    def cost_seen(self) -> np.ndarray:
        return np.zeros((20, 20))

    def sweep(self, lit_nats: float) -> None:
        pass


@pytest.mark.parametrize(
    ("told_apart", "by_itself", "kept"),
    [
        (20, 20, True),
        (4, 20, False),
        (20, 4, False),  # it is no better by itself: what stands out saves at any depth
    ],
)
def test_a_guess_must_be_better_told_apart_and_better_by_itself(
    monkeypatch: pytest.MonkeyPatch, told_apart: float, by_itself: float, *, kept: bool
):
    def explained(doubled: object, masks: np.ndarray) -> np.ndarray:
        return told_apart * masks[1] / 25

    def told_by_itself(doubled: object, masks: np.ndarray, piece: np.ndarray) -> list[np.ndarray]:
        return [by_itself * piece[1] / 25, np.zeros((20, 20))]

    monkeypatch.setattr(layer_search, "_explained", explained)
    monkeypatch.setattr(layer_search, "_told_by_itself", told_by_itself)
    still: Any = Still()
    cells = np.zeros((20, 20), dtype=bool)
    cells[5:10, 5:10] = True
    guess = guesses.Guess(1, cells, np.ones_like(cells))
    _, found = layer_search._tried(still, still, [guess], np.zeros((20, 20)))
    assert found == ([guess] if kept else [])
    assert still.masks[1].any() == kept


def test_borders_are_supposed_to_lie_farther_on_to_both_sides():
    counts, spread_px, truth = card_before_card(500)
    fitted = layers.Layers(counts, spread_px, (1e-3, 1e-2))
    fitted.put(layer_search._masks_of(truth, 2))
    supposed = [
        where
        for _, where in itertools.islice(
            guesses._supposed(fitted, [fitted.photons(layer) for layer in (0, 1)]), 2
        )
    ]
    columns = np.flatnonzero((truth == 1).any(axis=0))
    row = int(np.flatnonzero((truth == 1).any(axis=1)).mean())
    inner, outer = supposed[1][row], supposed[0][row]
    beyond = guesses.BEYOND_CELLS
    assert set(np.flatnonzero(inner)) == {
        *range(columns[0] - beyond, columns[0]),
        *range(columns[-1] + 1, columns[-1] + 1 + beyond),
    }
    assert set(np.flatnonzero(outer)) == {
        *range(columns[0], columns[0] + beyond),
        *range(columns[-1] + 1 - beyond, columns[-1] + 1),
    }


def test_what_crosses_something_is_supposed_between_what_is_seen_of_it():
    # A rod is seen on both sides of what it is hidden by, or taken for.
    rod = np.zeros((64, 64), dtype=bool)
    rod[30:34, 4:60] = True
    beside = rod.copy()
    beside[:, 20:44] = False
    hulls = list(guesses._hulls(beside, np.zeros(beside.shape)))
    assert any(np.array_equal(hull, rod) for hull in hulls)
    # Alone each side is its own hull; crumbs have none.
    assert len(hulls) == 3
    crumbs = np.zeros_like(rod)
    crumbs[::8, ::8] = True
    assert not list(guesses._hulls(crumbs, np.zeros(crumbs.shape)))


def test_of_many_pieces_those_two_are_joined_between_which_most_is_gained():
    # Five bars of which the ends are seen: 45 pairs. Between the ends of the narrowest there is a gain.
    bars = np.zeros((64, 64), dtype=bool)
    for number, wide in enumerate((6, 6, 4, 6, 6)):
        bars[4:60, 12 * number + 2 : 12 * number + 2 + wide] = True
    ends, smallest = bars.copy(), np.zeros_like(bars)
    ends[16:48] = False
    smallest[4:60, 26:30] = True
    gain = np.where(smallest & ~ends, 1.0, -1.0)
    *_, first, second = list(guesses._hulls(ends, gain))[: guesses.MOST_HULLS + 2]
    np.testing.assert_array_equal(first, smallest)
    assert not np.array_equal(second, smallest)


@pytest.mark.parametrize("radius", guesses.DISC_CELLS)
def test_discs_are_guessed_where_most_is_gained(radius: float, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(guesses, "DISC_CELLS", (radius,))
    i, j = np.indices((64, 64))
    gain = np.full((64, 64), -1.0)
    for row, column in ((20, 30), (44, 44)):
        gain[(i - row) ** 2 + (j - column) ** 2 < 7**2] = 1.0
    gain[:, 4:10] = 100.0  # what is the layer's already
    discs = list(guesses._discs(gain, j > 12))
    assert 2 <= len(discs) <= guesses.MOST_DISCS
    for row, column in ((20, 30), (44, 44)):
        # What is the layer's already pulls the widest by two cells, since it counts for nothing.
        away = [np.hypot(*(np.argwhere(disc).mean(axis=0) - (row, column))) for disc in discs[:2]]
        assert min(away) < 2.1
    assert discs[0].sum() == pytest.approx(np.pi * radius**2, rel=0.05)


def test_what_hides_another_costs_its_outline_and_what_is_lit_its_cells():
    # A card of 32 x 32 cells, one of 20 x 20 before its middle, and the same where half of it is in the dark.
    found = layers.Layers(bar_before_card(100), SPREAD_PX[:1].repeat(2), (1e-4, 1e-3))
    card, middle, beside = np.zeros((3, 64, 64), dtype=bool)
    card[16:48, 16:48] = middle[22:42, 22:42] = beside[22:42, 38:58] = True
    found.put(np.stack([card, np.zeros_like(card)]))
    alone = found.cost_seen().sum()
    for front, lit_cells in ((middle, 0), (beside, 20 * 10)):
        found.put(np.stack([card, front]))
        outline = layers.LENGTH_NATS * CELL_PX * 4 * 20
        more = found.cost_seen().sum() - alone
        # A corner's outline is cut off: sqrt(2) cells instead of two.
        assert more == pytest.approx(outline + layers.AREA_NATS * lit_cells, abs=layers.LENGTH_NATS * CELL_PX)


def test_a_piece_before_another_is_fitted_at_the_price_of_what_it_lights(monkeypatch: pytest.MonkeyPatch):
    # Both are at one depth, so that neither explains more.
    priced: list[np.ndarray] = []
    monkeypatch.setattr(
        "pcii.removal.likelihood.outline_kernels.shorten_outline", lambda gain, *_: priced.append(gain.copy())
    )
    found = layers.Layers(bar_before_card(100), SPREAD_PX[:1].repeat(2), (1e-4, 1e-3))
    card = np.zeros((64, 64), dtype=bool)
    card[16:48, 16:48] = True
    for lit_nats in (0.0, 0.1):
        found.put(np.stack([card, np.zeros_like(card)]))
        found.sweep(lit_nats)
    (_, dear, _, cheap), inside, outside = priced, np.s_[20:44, 20:44], np.s_[2:10, 20:44]
    np.testing.assert_allclose((cheap - dear)[inside], 0.1, atol=1e-3)
    np.testing.assert_allclose((cheap - dear)[outside], 0.0, atol=1e-3)


def test_a_film_that_is_dark_around_is_cut_to_what_is_lit(monkeypatch: pytest.MonkeyPatch):
    counts = bar_before_card(500)
    start = everything_at_the_card()
    whole = np.s_[0 : start.shape[0]], np.s_[0 : start.shape[1]]
    rows, cols = layer_search._box_of_light(start[8:12, 20:] >= 0, GRID, SPREAD_PX)
    assert (rows.start, rows.stop) == (0, 4)
    assert cols.stop == 44
    cut = layered(counts, SPREAD_PX, [start])
    monkeypatch.setattr(layer_search, "_box_of_light", lambda *_: whole)
    np.testing.assert_array_equal(cut, layered(counts, SPREAD_PX, [start]))


def test_without_photons_all_is_dark():
    counts = PhotonCounts.from_dense(np.zeros(GRID.shape_KLHW, np.int64), GRID, cfa="GRBG")
    seen = layered(counts, SPREAD_PX, [np.zeros((64, 64), np.int64)])
    np.testing.assert_array_equal(seen, -1)


@pytest.mark.parametrize("size", [(1, 1), (3, 9), (16, 5)])
@pytest.mark.parametrize("cfa", ["GRBG", None])
def test_tiny_films_have_an_answer(size, cfa):
    grid = unit_grid(2, 3, *size)
    counts = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, np.int64), grid, cfa=cfa)
    shape = -(-size[0] // CELL_PX), -(-size[1] // CELL_PX)
    seen = layered(counts, np.array([2.0, 40.0]), [np.zeros(shape, np.int64)])
    assert seen.shape == shape
    assert np.isin(seen, [-1, 0, 1]).all()


def moved(cells: np.ndarray, down: int, right: int) -> np.ndarray:
    """Cells (h, w) of what is seen at (i, j) and belongs to (i + down, j + right), pixel by pixel; else 0."""
    pixels = cells.repeat(CELL_PX, axis=0).repeat(CELL_PX, axis=1).astype(np.float64)
    result = np.zeros_like(pixels)
    for i, j in np.ndindex(*pixels.shape):
        if 0 <= i + down < pixels.shape[0] and 0 <= j + right < pixels.shape[1]:
            result[i, j] = pixels[i + down, j + right]
    h, w = cells.shape
    return result.reshape(h, CELL_PX, w, CELL_PX).mean(axis=(1, 3))


def test_who_hides_what_is_counted_as_pixel_by_pixel():
    # Shifts of every remainder, and one by which nothing is seen.
    rng = np.random.default_rng(3)
    V, (h, w), rows, cols = 6, (7, 5), np.array([-11, 2]), np.array([8, 1, -33])
    mask, light = rng.random((h, w)) < 0.5, rng.random((h, w)).astype(np.float32)
    mask[:2] = mask[:, 4] = False
    before = rng.integers(0, 24, (V, h, w)).astype(np.uint16)
    behind = rng.random((V, h, w)).astype(np.float32)
    shifts = list(itertools.product(rows, cols))
    seen = 1 - np.minimum(before / CELL_PX**2, 1)
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
        np.testing.assert_array_equal(covered[v], before[v] + CELL_PX**2 * share)
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
    seen = 1 - np.minimum(covered / CELL_PX**2, 1)
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


def test_a_flat_film_is_as_bright_where_half_of_the_views_are_hidden():
    rate, views = 0.5, 16
    grid = unit_grid(4, 4, 64, 64)
    film = np.random.default_rng(5).poisson(rate, grid.shape_KLHW)
    counts = PhotonCounts.from_dense(film, grid, cfa=None)
    events = counts.events
    hidden = ((events.k + events.l) % 2 == 0) & (events.j < 32)
    # The shifts are 0: of the left half every second view is hidden.
    seen = np.repeat(np.where(np.arange(16) < 8, 0.5, 1.0)[None], 16, axis=0).astype(np.float32)
    none = np.zeros(4, np.int32)
    N = events.n.size
    cell, own, base = np.zeros(N, np.int32), np.zeros(N, np.float32), np.zeros(N, np.float32)
    samples, mean, blurred = np.zeros((3, 16, 16), np.float32)
    where = events.k, events.l, events.i, events.j, counts.event_colours, events.n.astype(np.float32)
    weight = (~hidden).astype(np.float32)
    sites = np.array([4.0])
    land(*where[:4], none, none, (64, 64), cell)
    section = (none, none, 64, 64, sites, seen, 1.0)
    predict((*where, weight, cell), section, (own, base, samples, mean, blurred))
    for part in (np.s_[:, :8], np.s_[:, 8:]):
        photons = rate * 4 * views * 64 * 32 / 4 / 2  # per block and view; half of them are seen on the left
        assert abs(mean[part].mean() / (4 * rate) - 1) < 5 / np.sqrt(photons)
    # A hidden event is predicted, too, and takes no part in it: those beside it are all alike.
    assert abs(own[hidden].mean() / rate - 1) < 0.02


def test_events_are_predicted_the_same_in_parts_and_only_if_asked_for():
    counts = bar_before_card(40)
    events, (K, L, H, W) = counts.events, counts.grid.shape_KLHW
    N, (h, w), rng = events.n.size, (H // CELL_PX, W // CELL_PX), np.random.default_rng(4)
    rows, cols = 19 * np.arange(K, dtype=np.int32) - 50, 2 * np.arange(L, dtype=np.int32) - 5
    where = events.k, events.l, events.i, events.j
    cell = np.zeros(N, np.int32)
    land(*where, rows, cols, (H, W), cell)
    assert (cell < 0).any()
    weight, seen = rng.random(N).astype(np.float32), rng.random((h, w)).astype(np.float32)
    colours, sites, n = counts.event_colours, sites_of_colours(counts.cfa), events.n.astype(np.float32)
    about = (*where, colours, n, weight, cell), (rows, cols, H, W, sites, seen, 1.0)

    def outputs():
        return (*np.full((2, N), -1, np.float32), *np.full((3, h, w), -1, np.float32))

    whole, by_one = outputs(), outputs()
    predict_shared(1, np.ones(N, dtype=bool), (0, h), 0, *about, whole)
    predict(*about, by_one)
    for found, expected in zip(by_one[:3], whole[:3], strict=True):
        np.testing.assert_array_equal(found, expected)
    asked = rng.random(N) < 0.5
    in_rows = ((np.arange(h) >= 5) & (np.arange(h) < h - 2))[:, None] & np.ones(w, dtype=bool)
    for parts in (1, 3):
        rate, base, samples, mean, blurred = told = outputs()
        predict_shared(parts, asked, (5, h - 2), 0, *about, told)
        for found, expected in ((rate, whole[0]), (base, whole[1])):
            np.testing.assert_array_equal(found, np.where(asked, expected, -1))
        for found, expected in zip((samples, mean, blurred), whole[2:], strict=True):
            np.testing.assert_array_equal(found, np.where(in_rows, expected, -1))
        rate, base, samples, mean, blurred = told = outputs()
        predict_shared(parts, asked, (0, h), BASE_SCALE, *about, told)
        np.testing.assert_array_equal(base, np.where(asked, whole[1], -1))
        np.testing.assert_array_equal(blurred, whole[4])


def test_energy_hangs_on_the_masks_alone():
    # Most events are predicted by one layer only: what was predicted of them before must not come in.
    found = layers.Layers(bar_before_card(100), SPREAD_PX, (1e-4, 1e-3))
    card, bar = truth()
    found.put(np.stack([cells_of(card | bar), cells_of(bar)]))
    energy = found.energy()
    for stale in (found.rate, found.base, found.light, found.blurred, found.free):
        stale[:] = np.nan
    assert found.energy() == energy
    assert np.isfinite(energy)


def test_light_of_where_no_mask_is_does_not_grow():
    # A hundred comparisons later it would have been more than float32 can tell.
    found = layers.Layers(bar_before_card(100), SPREAD_PX, (1e-4, 1e-3))
    found.sweep()
    masks = found.masks.copy()
    masks[:, : len(found.light) // 2] = False
    found.put(masks)
    found.light_explained()
    before = found.light.copy()
    found.light_explained()
    np.testing.assert_array_equal(found.light, before)


def test_going_on_is_as_good_as_more_steps_at_once():
    gain = np.random.default_rng(1).normal(size=(12, 9)).astype(np.float32)
    at_once = np.zeros_like(gain)
    least_outline(gain, 1.0, 30, at_once)
    inside = (gain > 0).astype(np.float32)
    state = inside, inside.copy(), np.zeros_like(gain), np.zeros_like(gain)
    for _ in range(3):
        shorten_outline(gain, 1.0, 10, *state)
    np.testing.assert_array_equal(inside, at_once)

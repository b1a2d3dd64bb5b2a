"""The score on masks, outlines and depths small enough to count by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from twins import paper_grid

from pcii.base import InputError
from pcii.metrics import TrueFocus, boundary_f, entropy_half_widths, mask_agreement, object_share, score
from pcii.sections import reconstruct
from pcii.types import DepthMap, FocalPlanes, PhotonCounts, PhotonTruth, Segmented, Truth, blur_half_extent_px

GRID = paper_grid(24, 32)
Z = np.array([540.0, 620.0])


def truth() -> Truth:
    """A near object of 6 x 6 at 541 mm, a far one of 8 x 8 at 625 mm, nothing else."""
    z = np.full((24, 32), np.inf)
    ids = np.zeros((24, 32), dtype=np.int16)
    z[4:10, 4:10], ids[4:10, 4:10] = 541.0, 1
    z[8:16, 18:26], ids[8:16, 18:26] = 625.0, 2
    return Truth(z, ids, {1: "near", 2: "far"})


def true_focus(z_mm: np.ndarray = Z) -> TrueFocus:
    return TrueFocus(FocalPlanes.at_depths(GRID, z_mm), truth())


def segmented(masks: np.ndarray) -> Segmented:
    counts = PhotonCounts.from_dense(np.ones(GRID.shape_KLHW, dtype=np.int64), GRID)
    return Segmented(masks, "by hand", reconstruct(counts, Z))


@pytest.mark.parametrize(
    ("claimed", "true", "expected"),
    [
        (False, False, [None, None, None, None, None, 0.0]),
        (True, False, [None, 0.0, None, None, None, 1 / 9]),
        (False, True, [0.0, None, 0.0, 0.0, 0.0, 0.0]),
    ],
)
def test_empty_masks_have_defined_answers(claimed: bool, true: bool, expected: list[float | None]) -> None:
    square = np.zeros((9, 9), dtype=bool)
    square[3:6, 3:6] = True
    found = mask_agreement(square & claimed, square & true)
    keys = ("iou", "precision", "recall", "f1", "boundary_f", "false_share")
    assert [found[key] for key in keys] == expected
    iou, false_share = (1 / 9, 8 / 9) if true else (None, 1.0)
    assert found["everything"] == {"iou": iou, "false_share": false_share}


def test_pixel_truth_is_the_blur_of_one_pixel() -> None:
    # 541 mm is 0.11 px from 540 mm, 625 mm is 0.41 px from 620 mm, 650 mm would be 2.4 px.
    assert blur_half_extent_px(GRID, 541.0, 540.0) == pytest.approx(0.1094, abs=1e-4)
    masks = true_focus().by_pixel
    assert masks.sum(axis=(1, 2)).tolist() == [36, 64]
    assert not true_focus(np.array([650.0])).by_pixel.any()


def test_a_perfect_answer_scores_one() -> None:
    result = score(segmented(true_focus().by_object), DepthMap(*depth_of(truth())), truth())
    for row in result.planes:
        assert row["iou"] == row["precision"] == row["recall"] == row["boundary_f"] == 1.0
    assert [row["object"] for row in result.planes if row["truth"] == "object"] == ["near", "far"]
    for key in ("mae_mm", "median_mm", "median_px", "bad_1px", "bad_3px"):
        assert result.depth[key] == 0.0
    assert result.depth["coverage"] == 1.0
    assert result.depth["quadratic_score"] == 1.0
    assert {row["false_share"] for row in result.planes} == {0.0}


def test_a_floor_belongs_to_no_plane_and_a_table_counts_in_no_score() -> None:
    """A floor leans through all depths beside the near object, and the far one stands on a table."""
    base = truth()
    z, ids = base.z_mm.copy(), base.object_id.copy()
    z[20:], ids[20:] = np.linspace(480.0, 900.0, 32), 3
    z[16:18, 18:26], ids[16:18, 18:26] = 620.0, 4
    names = {1: "near", 2: "far", 3: "floor", 4: "table"}
    true = TrueFocus(FocalPlanes.at_depths(GRID, Z), Truth(z, ids, names, unscored=frozenset({4})))
    assert true.plane_of == {1: 0, 2: 1}
    at_planes = [blur_half_extent_px(GRID, z[20], depth) for depth in Z]
    far_floor = np.zeros((24, 32), dtype=bool)
    far_floor[20:, at_planes[1] > 4] = True
    for free in (ids == 4, (ids == 3) & ~far_floor):  # claimed or not, the scores are the same
        masks = true.by_object.copy()
        masks[1] |= free
        rows = score(segmented(masks), None, true.truth).planes
        for row in rows[::2]:
            assert (row["truth"], row["iou"], row["precision"], row["false_share"]) == ("object", 1, 1, 0)
    masks = true.by_object.copy()
    masks[1] |= far_floor
    wrong = score(segmented(masks), None, true.truth).planes[2]
    assert wrong["iou"] == wrong["precision"] == 64 / (64 + far_floor.sum())
    assert wrong["false_share"] == far_floor.mean()
    # By pixel the floor counts where it is in focus, and the table does not.
    in_focus = at_planes[1] <= 1
    assert true.by_pixel[1].sum() == 64 + 4 * in_focus.sum() > 64
    depth = score(None, DepthMap(*depth_of(truth())), true.truth, grid=GRID).depth
    assert depth["coverage"] == (36 + 64) / (36 + 64 + 4 * 32)


def depth_of(true: Truth) -> tuple[np.ndarray, np.ndarray]:
    z = np.where(np.isfinite(true.z_mm), true.z_mm, np.nan)
    return z, np.isfinite(z).astype(float)


def test_depth_errors_are_in_px_of_total_disparity() -> None:
    z, confidence = depth_of(truth())
    # At 541 mm the total disparity is 118.15 px and 1 mm is 0.22 px: 9 mm is 1.9 px, 20 mm 4.2 px.
    z[4:10, 4:7] += 9.0
    z[4:10, 7:10] += 20.0
    result = score(segmented(true_focus().by_object), DepthMap(z, confidence), truth())
    assert result.depth["bad_1px"] == 0.36
    assert result.depth["bad_3px"] == 0.18
    assert result.depth["mae_mm"] == pytest.approx((18 * 9 + 18 * 20) / 100)
    assert result.depth["median_px"] == 0.0
    assert (result.depth["within_1px"], result.depth["within_3px"]) == (0.64, 0.82)
    # The far object of 64 of 100 pixels has one depth.
    best = {"within_1px": 0.64, "within_3px": 0.64, "quadratic_score": pytest.approx(0.64**2)}
    assert result.depth["one_depth"] == best


def test_a_depth_map_alone_is_scored_with_the_grid() -> None:
    depth = DepthMap(*depth_of(truth()))
    result = score(None, depth, truth(), grid=GRID)
    assert result.planes == result.objects == ()
    assert result.depth["coverage"] == 1.0
    assert [row["name"] for row in result.bounds["objects"]] == ["near", "far"]
    with pytest.raises(InputError, match=r"^grid: a depth map without masks"):
        score([], depth, truth())
    with pytest.raises(InputError, match=r"^truth: its maps are \(24, 32\), the estimates \(1, 1\)"):
        score(None, DepthMap(np.ones((1, 1)), np.ones((1, 1))), truth(), grid=GRID)


def test_without_truth_everything_unknown_is_none() -> None:
    result = score(segmented(np.zeros((2, 24, 32), dtype=bool)), None, None)
    assert all(row["iou"] is None and row["entropy_before"] is not None for row in result.planes)
    assert result.objects == ()
    assert all(set(v.values() if isinstance(v, dict) else [v]) == {None} for v in result.depth.values())
    assert result.bounds == {"objects": []}


def photon_score(
    kept: list[bool] | None, kind: str = "pixel", unscored: frozenset[int] = frozenset()
) -> tuple[float | None, float | None]:
    """Precision and recall of four events of 3, 1, 2 and 1 photons; the third sent one photon of each kind.

    They are in view (0, 0), which the section at 540 mm moves by floor(-4.5 x 13.15 + 1/2) = -59 px, so
    that a picture of 200 px is needed to contain all of them.
    """
    wide = paper_grid(200, 200)
    i, j, n = np.array([100, 110, 120, 199]), np.array([100, 100, 100, 30]), np.array([3, 1, 2, 1])
    where = np.zeros(4, dtype=int), np.zeros(4, dtype=int), i, j
    counts = PhotonCounts.from_events(*where, n, wide)
    # The last photon is projected left of the section and does not count.
    origins = np.array([1, 1, 1, 2, 1, 2, 1]), np.array([541.0, 541, 541, 625, 541, 625, 541])
    photons = PhotonTruth(*(column.repeat(n) for column in where), *origins)
    z, ids = np.full((200, 200), np.inf), np.zeros((200, 200), dtype=np.int16)
    z[0], ids[0], z[1], ids[1] = 541.0, 1, 625.0, 2
    true = Truth(z, ids, {1: "near", 2: "far"}, photons, unscored=unscored)
    masks = np.zeros((1, 200, 200), dtype=bool)
    masks[0, 41, 41] = True  # where the event of three photons is projected to
    in_focus = None if kept is None else np.array([kept])
    focus = Segmented(masks, "by hand", reconstruct(counts, Z[:1]), photon_in_focus=in_focus)
    rows = score(focus, None, true).planes
    assert all(row["iou"] is not None for row in rows)
    row = next(row for row in rows if row["truth"] == kind)
    return row["photon_precision"], row["photon_recall"]


def test_photons_count_once_each_by_what_is_said_of_their_event_or_by_the_mask() -> None:
    # Of object 1 four photons land inside: three of the first event, one of the third.
    assert photon_score(None) == (1.0, 3 / 4)
    assert photon_score([False, True, True, True]) == (1 / 3, 1 / 4)
    assert photon_score([True, False, True, False]) == (4 / 5, 1.0)
    assert photon_score([False] * 4) == (None, 0.0)
    # The far object does not belong to the only plane.
    assert photon_score([True, False, True, False], "object") == (4 / 5, 1.0)
    assert photon_score([False, True, False, False], "object") == (0.0, 0.0)
    assert photon_score([False, True, False, False], "object", frozenset({2})) == (None, 0.0)  # not scored
    with pytest.raises(InputError, match=r"^photon_in_focus: has 3 events, .* to 4; .*photons=None"):
        photon_score([True] * 3)


def half_plane(edge_px: float, height: int = 20, width: int = 30) -> np.ndarray:
    """Share of each pixel that is left of the column `edge_px`; pixel j spans j - 1/2 to j + 1/2."""
    row = np.clip(edge_px - (np.arange(width) - 0.5), 0, 1)
    return np.tile(row, (height, 1))


def mask_of(share: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mask, ids and coverage as first hits give them, of an object with this share of each pixel."""
    mask = share > 0.5
    return mask, mask.astype(np.int16), np.where(mask, share, 1 - share).astype(np.float32)


@pytest.mark.parametrize("edge_px", [10.0, 10.2, 10.49, 10.51, 10.8])
def test_the_share_of_a_mask_is_given_back(edge_px: float) -> None:
    share = half_plane(edge_px)
    np.testing.assert_allclose(object_share(*mask_of(share)), share, atol=1e-6)


def test_what_is_beside_another_object_of_the_mask_is_no_edge() -> None:
    mask, ids, coverage = mask_of(half_plane(10.2))
    both = object_share(np.ones_like(mask), ids + 1, coverage)
    np.testing.assert_allclose(both, 1, atol=1e-6)
    neither = object_share(np.zeros_like(mask), ids + 1, coverage)
    assert (neither == 0).all()


def test_a_shift_of_an_outline_by_a_tenth_of_a_pixel_shows() -> None:
    # A claimed edge between the columns 12 and 13, at 12.5: 2.05 px from 10.45, 1.95 px from 10.55.
    claimed = half_plane(12.5) > 0.5
    for edge_px, expected in ((10.45, 0.0), (10.55, 1.0)):
        true, _, _ = mask_of(half_plane(edge_px))
        assert boundary_f(claimed, true, half_plane(edge_px)) == expected


def test_masks_without_an_outline_and_films_of_one_pixel() -> None:
    square = np.zeros((9, 9), dtype=bool)
    square[3:6, 3:6] = True
    empty = np.zeros_like(square)
    assert boundary_f(square, empty, empty.astype(float)) == 0.0
    assert boundary_f(square, square, square.astype(float)) == 1.0
    row = np.array([[True, True, False, False, False, False, False, False]])
    assert boundary_f(row, row, row.astype(float)) == 1.0
    assert boundary_f(row, row[:, ::-1], row[:, ::-1].astype(float)) == 0.0


def test_the_score_uses_the_coverage_if_there_is_one() -> None:
    grid = paper_grid(20, 30)
    mask, ids, coverage = mask_of(half_plane(10.45))
    z = np.where(mask, 540.0, np.inf)
    counts = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, dtype=np.int64), grid)
    claimed = (half_plane(12.5) > 0.5)[None]
    focus = Segmented(claimed, "by hand", reconstruct(counts, [540.0]))
    plain = score(focus, None, Truth(z, ids, {1: "edge"}))
    fine = score(focus, None, Truth(z, ids, {1: "edge"}, coverage=coverage))
    # In whole pixels the outlines are 2 px apart (columns 10 and 12), in truth 2.05 px.
    for coarse_row, fine_row in zip(plain.planes, fine.planes, strict=True):
        assert (coarse_row["boundary_f"], fine_row["boundary_f"]) == (1.0, 0.0)
        assert coarse_row["iou"] == fine_row["iou"]


def test_intervals_of_entropies_are_as_long_as_draws_of_the_photons_differ() -> None:
    rng, where = np.random.default_rng(5), truth()
    light = 0.02 * (1 + np.arange(32) / 8) * np.ones(GRID.shape_KLHW)
    entropies, half_widths = [], []
    draws = [PhotonCounts.from_dense(rng.poisson(light), GRID) for _ in range(40)]
    for counts in draws:
        sections = reconstruct(counts, Z)
        masks = Segmented(np.ones((2, 24, 32), dtype=bool), "all", sections)
        entropies.append([[*row["entropy"].values()] for row in score(masks, None, where).objects])
        half_widths.append([[*row.values()] for row in entropy_half_widths(counts, sections, where)])
    found = np.mean(np.square(half_widths), axis=0) / stats.t.ppf(0.975, 9) ** 2
    # A variance over 40 draws is off by 23 %, and the jackknife's is too large (Efron and Stein): here by 2.
    ratio = found / np.var(entropies, axis=0, ddof=1)
    assert ratio.min() > 0.5
    assert ratio.max() < 3
    # Of an object that is not scored there is neither.
    of_other = replace(where, unscored=frozenset({1}))
    half_scored = entropy_half_widths(draws[-1], reconstruct(draws[-1], Z), of_other)
    np.testing.assert_allclose([[*row.values()] for row in half_scored], half_widths[-1][1:], rtol=1e-12)

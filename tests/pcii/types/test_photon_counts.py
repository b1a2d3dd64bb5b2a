import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from property_settings import at_least
from twins import unit_grid

from pcii.base.errors import InputError
from pcii.sections.reconstruction import reconstruct
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts
from pcii.types.photon_limit import limit_photons


def events_of(counts: PhotonCounts) -> list[tuple[int, ...]]:
    e = counts.events
    columns = (e.k.tolist(), e.l.tolist(), e.i.tolist(), e.j.tolist(), e.n.tolist())
    return list(zip(*columns, strict=True))


def test_events_are_sorted_repeats_added_and_zeros_dropped():
    rows = [(1, 0, 2, 3, 4), (0, 2, 0, 0, 1), (1, 0, 2, 3, 5), (0, 0, 1, 1, 0)]
    counts = PhotonCounts.from_events(*np.array(rows).T, unit_grid(2, 3, 4, 6))
    assert events_of(counts) == [(0, 2, 0, 0, 1), (1, 0, 2, 3, 9)]
    assert counts.total == 10


small_counts = st.builds(
    lambda seed, shape, rate: np.random.default_rng(seed).poisson(rate, size=shape),
    st.integers(0, 999),
    st.tuples(st.integers(1, 3), st.integers(1, 3), st.integers(1, 5), st.integers(1, 5)),
    st.sampled_from([0.0, 0.2, 3.0]),
)


@given(dense=small_counts, shuffle=st.integers(0, 99))
@at_least(100)
def test_dense_and_events_hold_the_same_counts_in_any_order(dense, shuffle):
    grid = unit_grid(*dense.shape)
    from_dense = PhotonCounts.from_dense(dense, grid, cfa="GRBG")
    where = np.random.default_rng(shuffle).permutation(np.argwhere(dense))
    n = dense[tuple(where.T)]
    # Photons of a pixel given as separate events are the same counts.
    single = np.repeat(where, n, axis=0)
    for rows, photons in ((where, n), (single, np.ones(len(single), dtype=int))):
        sparse = PhotonCounts.from_events(*rows.T, photons, grid, cfa="GRBG")
        assert events_of(sparse) == events_of(from_dense)
        assert sparse.total == from_dense.total == dense.sum()
        for k, l in np.ndindex(grid.rows, grid.cols):
            np.testing.assert_array_equal(sparse.view(k, l), dense[k, l])
            np.testing.assert_array_equal(from_dense.view(k, l), dense[k, l])
            np.testing.assert_array_equal(sparse[k - grid.rows, l], dense[k, l])
        np.testing.assert_array_equal(sparse.dense, dense)
        np.testing.assert_array_equal(from_dense.dense, dense)


@pytest.mark.parametrize("column", range(4))
def test_an_index_outside_the_grid_is_refused_by_name(column):
    grid = unit_grid(2, 3, 4, 5)
    for bad in (grid.shape_KLHW[column], -1):
        row = [0, 0, 0, 0, 1]
        row[column] = bad
        with pytest.raises(InputError, match=f"^{'klij'[column]}: "):
            PhotonCounts.from_events(*np.array([row]).T, grid)


@pytest.mark.parametrize("bad", [-1, 0.5, float("nan"), float("inf")])
def test_a_count_that_is_no_whole_number_is_refused(bad):
    grid = unit_grid(1, 1, 2, 2)
    with pytest.raises(InputError, match=r"^n: photon counts must"):
        PhotonCounts.from_events(*np.zeros((4, 1), dtype=int), np.array([bad]), grid)
    dense = np.zeros((1, 1, 2, 2))
    dense[0, 0, 1, 1] = bad
    with pytest.raises(InputError, match=r"^counts: photon counts must"):
        PhotonCounts.from_dense(dense, grid)


def test_arrays_that_do_not_fit_are_refused_by_name():
    grid, zeros, one = unit_grid(1, 1, 2, 2), np.zeros((1, 1, 2, 2), dtype=int), np.zeros(1, dtype=int)
    with pytest.raises(InputError, match=r"^counts: expected shape \(1, 1, 2, 2\)"):
        PhotonCounts.from_dense(zeros[..., :1], grid)
    with pytest.raises(InputError, match=r"^counts: photon counts must be whole numbers, got complex128"):
        PhotonCounts.from_dense(zeros.astype(complex), grid)
    with pytest.raises(InputError, match=r"^counts: masked"):
        PhotonCounts.from_dense(np.ma.masked_equal(zeros, 0), grid)
    with pytest.raises(InputError, match=r"same length"):
        PhotonCounts.from_events(one, one, one, one, np.ones(2, dtype=int), grid)
    with pytest.raises(InputError, match="no camera"):
        PhotonCounts.from_dense(zeros, grid).view(-1, 0)
    with pytest.raises(InputError, match=r"^seed: "):
        limit_photons(Views(np.ones((1, 1, 2, 2, 1)), grid), 10, seed=-1)


def test_counts_stay_as_they_are_when_the_array_changes():
    dense = np.ones((1, 1, 2, 2), dtype=np.uint16)
    counts = PhotonCounts.from_dense(dense, unit_grid(1, 1, 2, 2))
    dense[:] = 9
    assert counts.dense.sum() == 4


def test_counts_in_half_precision_are_whole_numbers_without_a_warning():
    dense = np.full((1, 1, 2, 2), 2048, np.float16)
    assert PhotonCounts.from_dense(dense, unit_grid(1, 1, 2, 2)).total == 8192


def test_photons_are_drawn_fairly_and_always_alike() -> None:
    grid, rng = unit_grid(7, 7, 32, 32), np.random.default_rng(6)
    many = rng.poisson(rng.uniform(0, 4, 49)[:, None], (49, 1024)).reshape(grid.shape_KLHW)
    counts = PhotonCounts.from_dense(many, grid, cfa="GRBG")
    most = counts.total / 5
    few = counts.subsample(most, np.random.default_rng(0))
    assert (few.grid, few.cfa) == (grid, "GRBG")
    assert abs(few.total - most) < 5 * np.sqrt(most)
    kept = np.stack([few.view(k, l) for k in range(7) for l in range(7)]).reshape(many.shape)
    assert (kept <= many).all()
    # Views keep their shares: chi square of 48 degrees of freedom, 5 deviations of its mean of 48.
    by_view, expected = kept.sum(axis=(2, 3)), many.sum(axis=(2, 3)) / 5
    chi2 = ((by_view - expected) ** 2 / (0.8 * expected)).sum()
    assert 48 - 5 * np.sqrt(96) < chi2 < 48 + 5 * np.sqrt(96)
    again = PhotonCounts.from_events(*(getattr(few.events, name) for name in "klijn"), grid, cfa="GRBG")
    for name in "klijn":
        np.testing.assert_array_equal(getattr(few.events, name), getattr(again.events, name))
        np.testing.assert_array_equal(
            getattr(few.events, name), getattr(counts.subsample(most, np.random.default_rng(0)).events, name)
        )
    assert counts.subsample(counts.total, np.random.default_rng(0)) is counts


# Totals


MANY = 1 << 23
MOST = np.int64(1 << 40)  # in one pixel; 2^23 of them are 2^63, one more than int64 holds


def test_events_that_add_up_to_more_than_int64_holds_are_refused_by_name() -> None:
    grid = unit_grid(1, 1, 1, MANY)
    zeros, cols = np.zeros(MANY, dtype=np.uint8), np.arange(MANY)
    with pytest.raises(InputError, match=r"^n: 9223372036854775808 photons in all"):
        PhotonCounts.from_events(zeros, zeros, zeros, cols, np.full(MANY, MOST), grid)
    just = np.full(MANY, MOST)
    just[0] -= 1
    assert PhotonCounts.from_events(zeros, zeros, zeros, cols, just, grid).total == (1 << 63) - 1


@pytest.mark.parametrize("kept", ["events", "dense"])
def test_a_selection_of_cameras_keeps_the_place_of_a_point(kept: str):
    """A point at 1 mm falls on itself in sections of any cameras, at the place that their centre says."""
    grid = unit_grid(5, 6, 40, 40, pitch_mm=(4.0, 2.0))
    dense = np.zeros(grid.shape_KLHW, dtype=int)
    for k, l in np.ndindex(5, 6):  # the disparity is 4 px across and 2 down
        dense[k, l, 20 - 2 * (k - 2), 26 - 4 * (l - 2)] = 1 + l
    counts = PhotonCounts.from_dense(dense, grid)
    if kept == "events":
        e = counts.events
        counts = PhotonCounts.from_events(e.k, e.l, e.i, e.j, e.n, grid)
    some = counts[1:4, 1::2]
    assert some.is_sparse == (kept == "events")
    np.testing.assert_array_equal(some.dense, dense[1:4, 1::2])
    assert some.grid.pitch_mm == (8.0, 2.0)
    section = reconstruct(some, z_mm=1.0).counts[0, ..., 0]
    assert np.argwhere(section).tolist() == [[20, 22]]  # of the cameras 1, 3, 5 the middle one is 3
    assert section.max() == 3 * (2 + 4 + 6)
    assert counts[2, -2:].grid.shape_KLHW == (1, 2, 40, 40)


@pytest.mark.parametrize(
    ("cameras", "message"),
    [
        ((3, 0), "k: expected a camera of 0 .. 2"),
        ((0, slice(4, None)), "l: a slice must choose cameras of 0 .. 3"),
        ((slice(None, None, -1), 0), "k: a slice must choose cameras of 0 .. 2 in their order"),
        ((0.5, slice(None)), "k: expected a camera of 0 .. 2, or a slice"),
        (0, "cameras: expected two numbers or slices"),
        ((slice(None), slice(2)), "l: cameras of a sheared grid must lie symmetrically"),
    ],
)
def test_cameras_that_cannot_be_chosen_are_named(cameras, message):
    grid = unit_grid(3, 4, 2, 2, shear_px=(0.5, 0.0))
    counts = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, dtype=int), grid)
    assert counts[:2, 1:3].grid.shear_px == (0.5, 0.0)
    with pytest.raises(InputError, match=f"^{message}"):
        counts[cameras]

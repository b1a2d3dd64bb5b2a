"""The loops that predict photons from a section: by threads, and where views are hidden."""

import numpy as np
from twins import even_light, unit_grid

from pcii.base.compiled_loops import threads, use_threads
from pcii.evidence.cells import CELL_PX
from pcii.evidence.prediction_kernels import predict, predict_shared
from pcii.evidence.prediction_types import PlacedEvents, PlaneView, Predicted
from pcii.evidence.projection_kernels import cells_of_events
from pcii.types.bayer import sites_of_colours


def test_a_flat_film_is_as_bright_where_half_of_the_views_are_hidden():
    rate, views = 0.5, 16
    grid = unit_grid(4, 4, 64, 64)
    counts = even_light(grid, rate, seed=5)
    events = counts.events
    hidden = ((events.k + events.l) % 2 == 0) & (events.j < 32)
    # The shifts are 0: of the left half every second view is hidden.
    view_share = np.repeat(np.where(np.arange(16) < 8, 0.5, 1.0)[None], 16, axis=0).astype(np.float32)
    none = np.zeros(4, np.int32)
    N = events.n.size
    cell, rates, base = np.zeros(N, np.int32), np.zeros(N, np.float32), np.zeros(N, np.float32)
    samples, mean, blurred = np.zeros((3, 16, 16), np.float32)
    where = events.k, events.l, events.i, events.j, counts.event_colours, events.n.astype(np.float32)
    weight = (~hidden).astype(np.float32)
    sites = np.array([4.0])
    cells_of_events(*where[:4], none, none, (64, 64), CELL_PX, cell)
    section = PlaneView(none, none, 64, 64, sites, view_share, 1.0)
    predict(PlacedEvents(*where, weight, cell), section, Predicted(rates, base, samples, mean, blurred))
    for part in (np.s_[:, :8], np.s_[:, 8:]):
        photons = rate * 4 * views * 64 * 32 / 4 / 2  # per block and view; half of them are seen on the left
        assert abs(mean[part].mean() / (4 * rate) - 1) < 5 / np.sqrt(photons)
    # A hidden event is predicted, too, and takes no part in it: those beside it are all alike.
    assert abs(rates[hidden].mean() / rate - 1) < 0.02


def test_events_are_predicted_the_same_by_any_number_of_threads_and_only_if_selected():
    K, L, H, W = 4, 5, 96, 128
    counts = even_light(unit_grid(K, L, H, W), 0.02, seed=3, cfa="GRBG")
    events = counts.events
    N, (h, w), rng = events.n.size, (H // 4, W // 4), np.random.default_rng(4)
    rows, cols = 19 * np.arange(K, dtype=np.int32) - 30, 2 * np.arange(L, dtype=np.int32) - 5
    where = events.k, events.l, events.i, events.j
    cell = np.zeros(N, np.int32)
    cells_of_events(*where, rows, cols, (H, W), CELL_PX, cell)
    assert (cell < 0).any()
    weight, view_share = rng.random(N).astype(np.float32), rng.random((h, w)).astype(np.float32)
    colours, sites, n = counts.event_colours, sites_of_colours(counts.cfa), events.n.astype(np.float32)
    about = (
        PlacedEvents(*where, colours, n, weight, cell),
        PlaneView(rows, cols, H, W, sites, view_share, 1.0),
    )

    def outputs():
        return Predicted(*np.full((2, N), -1, np.float32), *np.full((3, h, w), -1, np.float32))

    whole, by_one = outputs(), outputs()
    predict_shared(np.ones(N, dtype=bool), (0, h), 0, *about, whole)
    predict(*about, by_one)
    for found, expected in zip(by_one[:3], whole[:3], strict=True):
        np.testing.assert_array_equal(found, expected)
    selected = rng.random(N) < 0.5
    in_rows = ((np.arange(h) >= 5) & (np.arange(h) < h - 2))[:, None] & np.ones(w, dtype=bool)
    before = threads()
    for count in (1, 2):
        use_threads(count)
        rate, base, samples, mean, blurred = predicted = outputs()
        predict_shared(selected, (5, h - 2), 0, *about, predicted)
        for found, expected in ((rate, whole[0]), (base, whole[1])):
            np.testing.assert_array_equal(found, np.where(selected, expected, -1))
        for found, expected in zip((samples, mean, blurred), whole[2:], strict=True):
            np.testing.assert_array_equal(found, np.where(in_rows, expected, -1))
        # The widest window alone: scale 4, of 2 px << 4.
        rate, base, samples, mean, blurred = predicted = outputs()
        predict_shared(selected, (0, h), 4, *about, predicted)
        np.testing.assert_array_equal(base, np.where(selected, whole[1], -1))
        np.testing.assert_array_equal(blurred, whole[4])
    use_threads(before)

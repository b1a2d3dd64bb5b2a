import numpy as np

from pcii.imaging.watershed_pieces import pieces_alike


def test_what_is_alike_is_one_before_what_differs():
    # Four stripes in a row: of one colour are the first and the second, and the third and the fourth.
    pieces = np.repeat([1, 2, 3, 4], 10)[None].repeat(20, axis=0)
    rates = np.array([[0, 9, 9, 3, 3], [0, 3, 3, 9, 9]])[:, pieces]
    photons = np.random.default_rng(1).poisson(rates)
    found = [tuple(np.unique(pieces[mask])) for mask in pieces_alike(pieces, photons)]
    assert found[:4] == [(1,), (2,), (3,), (4,)]
    assert set(found[4:6]) == {(1, 2), (3, 4)}
    assert found[6:] == [(1, 2, 3, 4)]


def test_what_is_no_piece_and_what_does_not_touch_is_left_alone():
    pieces = np.array([[1, 1, 0, 2, 2], [1, 1, 0, 2, 2]])
    found = list(pieces_alike(pieces, np.ones((1, 2, 5))))
    assert [np.unique(pieces[mask]).tolist() for mask in found] == [[1], [2]]
    assert not list(pieces_alike(np.zeros((3, 3), np.int32), np.ones((1, 3, 3))))
    # Without a photon all are alike.
    dark = np.repeat([1, 2, 3], 2)[None]
    assert np.unique(dark[list(pieces_alike(dark, np.zeros((3, 1, 6))))[-1]]).size == 3

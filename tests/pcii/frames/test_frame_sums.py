"""Counts of binary frames, whether single counts are few or many, and of which frames of the exposure."""

from pathlib import Path

import numpy as np
import pytest
from photon_cubes import FRAMES, bits_of
from twins import unit_grid

from pcii.frames import frame_files, frame_sums
from pcii.frames.frame_files import files_of_views
from pcii.frames.frame_sums import binary_counts

GRID = unit_grid(2, 3, 5, 13)


def saved(folder: Path, bits: np.ndarray) -> np.ndarray:
    """Files (K, L) of packed views."""
    paths = np.empty(bits.shape[:2], object)
    for camera in np.ndindex(paths.shape):
        paths[camera] = path = folder / f"{camera[0]}_{camera[1]}.npy"
        np.save(path, np.packbits(bits[camera], axis=2))
    return paths


@pytest.mark.parametrize("most_kept", [1 << 24, 100, 0])
@pytest.mark.parametrize("piece_bytes", [1 << 23, 25, 1])
@pytest.mark.parametrize("span", [(0, FRAMES), (2, 6), (8, 9)])
def test_sums_do_not_depend_on_what_is_kept(tmp_path, monkeypatch, most_kept, piece_bytes, span) -> None:
    monkeypatch.setattr(frame_sums, "MOST_KEPT", most_kept)
    monkeypatch.setattr(frame_sums, "SEARCHED_BYTES", piece_bytes)
    monkeypatch.setattr(frame_files, "PIECE_BYTES", piece_bytes)
    bits = bits_of(GRID)
    files = files_of_views(saved(tmp_path, bits), packed=True)
    counts = binary_counts(files, GRID, span, cfa="RGGB")
    seen = bits[:, :, span[0] : span[1]]
    np.testing.assert_array_equal(counts.dense, seen.sum(axis=2))
    assert (counts.readout.frames, counts.readout.bits, counts.cfa) == (span[1] - span[0], 1, "RGGB")
    if seen.sum() > most_kept:
        assert counts.frame is None
        assert counts.dense.dtype == np.uint8
    else:
        events = counts.frame_events
        assert events is not None
        found = np.stack([events.k, events.l, events.i, events.j, events.frame], axis=1)
        np.testing.assert_array_equal(found, np.argwhere(seen.transpose(0, 1, 3, 4, 2)))

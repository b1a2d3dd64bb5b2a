"""The one table of photons, from where they are drawn to the file that they are written to."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from pcii.types import CameraGrid, colour_cells, read_only

NO_OBJECT = -1
"""Object id of a count that no photon made."""
DTYPES = dict.fromkeys(("k", "l", "i", "j", "scope", "rank", "frame"), np.int32) | {
    "n": np.int64,
    "object_id": np.int16,
    "z_mm": np.float32,
}


@dataclass(frozen=True, eq=False)
class PhotonTable:
    """Photons, or counts that come of them: columns (N,) of the types in `DTYPES`, read-only.

    `n` photons at pixel (i, j) of camera (k, l); a pixel may have several rows. Single photons (n = 1) that
    are counted over a budget have the number of its `scope` and their `rank` within that, from 0: the first
    r of a scope are themselves an exact draw of r photons. Both are -1 for counts of no budget. `object_id`
    and planar depth `z_mm` are those of the first hit; `NO_OBJECT` and +inf for counts that no photon made.
    `frame` is that of the exposure, from 0, in which a single one is counted. What is not known of any row is
    None. Raises `ValueError` for columns of different lengths.
    """

    k: np.ndarray
    l: np.ndarray
    i: np.ndarray
    j: np.ndarray
    n: np.ndarray
    scope: np.ndarray | None = None
    rank: np.ndarray | None = None
    object_id: np.ndarray | None = None
    z_mm: np.ndarray | None = None
    frame: np.ndarray | None = None

    def __post_init__(self) -> None:
        for name, column in self.columns().items():
            if column.shape != (self.k.shape[0],):
                raise ValueError(f"{name}: expected {self.k.shape[0]} rows, got shape {column.shape}")
            object.__setattr__(self, name, read_only(np.asarray(column, dtype=DTYPES[name])))

    def columns(self) -> dict[str, np.ndarray]:
        """The columns that are known, by name."""
        known = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: column for name, column in known.items() if column is not None}

    def take(self, which: np.ndarray) -> "PhotonTable":
        """Some rows, by mask or index."""
        return PhotonTable(**{name: column[which] for name, column in self.columns().items()})

    def one_by_one(self) -> "PhotonTable":
        """A row for each photon, in the same order."""
        columns = {name: column.repeat(self.n) for name, column in self.columns().items() if name != "n"}
        return PhotonTable(**columns, n=np.ones(columns["k"].size, dtype=DTYPES["n"]))

    def flat_pixels(self, grid: CameraGrid) -> np.ndarray:
        """Index (N,), int64, of each row's pixel among those of all views."""
        return np.ravel_multi_index((self.k, self.l, self.i, self.j), grid.shape_KLHW)

    def by_pixel(self, grid: CameraGrid) -> "PhotonTable":
        """Ordered by view and pixel, rows of one pixel as they were."""
        pixel = self.flat_pixels(grid)
        if (pixel[1:] >= pixel[:-1]).all():  # tens of millions of photons are not copied for nothing
            return self
        # With the place in the table as a last digit no two are equal, and any sort will do.
        return self.take(np.argsort(pixel * pixel.size + np.arange(pixel.size)))

    def colours(self, cfa: str | None) -> np.ndarray:
        """Colour (N,), int64, of each row's pixel: 0, 1, 2 = R, G, B; 1 for a monochrome sensor."""
        if cfa is None:
            return np.ones(self.k.size, dtype=np.int64)
        return colour_cells(cfa)[self.i % 2, self.j % 2]


def joined(parts: Sequence[PhotonTable]) -> PhotonTable:
    """Rows of all parts, one part after the other, with the columns that are known of all."""
    if len(parts) == 1:
        return parts[0]
    known = [part.columns() for part in parts]
    names = [name for name in known[0] if all(name in columns for columns in known)]
    return PhotonTable(**{name: np.concatenate([columns[name] for columns in known]) for name in names})


def no_photons() -> PhotonTable:
    """A table without rows, all of whose columns are known."""
    return PhotonTable(**{name: np.zeros(0, dtype) for name, dtype in DTYPES.items()})

"""Photon counts of the elemental images, as sparse events or as a dense stack, and their frames."""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pcii.base import InputError, ShortForm, times
from pcii.types.arrays import Plottable, is_whole, read_only, whole_counts
from pcii.types.cameras import PLAIN, CameraGrid, Readout, channel_count, check_cfa, colour_cells


@dataclass(frozen=True, repr=False)
class PhotonEvents(ShortForm):
    """Pixels with photons: camera (k, l), pixel (i, j), `n` photons; five arrays (N,) of integers."""

    k: np.ndarray
    l: np.ndarray
    i: np.ndarray
    j: np.ndarray
    n: np.ndarray

    def _facts(self) -> dict[str, object]:
        return {"events": self.n.size, "photons": int(self.n.sum())}


@dataclass(frozen=True, repr=False)
class FrameEvents:
    """Single counts: camera (k, l), pixel (i, j) and `frame`, from 0; five arrays (N,) of integers."""

    k: np.ndarray
    l: np.ndarray
    i: np.ndarray
    j: np.ndarray
    frame: np.ndarray


def _events_of(pixels: tuple[np.ndarray, ...], n: np.ndarray) -> PhotonEvents:
    """Events of pixels (k, l, i, j) that are sorted, one event each."""
    k, l, i, j = (read_only(index.astype(np.int32, copy=False)) for index in pixels)
    return PhotonEvents(k, l, i, j, read_only(n))


def _sorted_events(pixels: tuple[np.ndarray, ...], n: np.ndarray, grid: CameraGrid) -> PhotonEvents:
    """Events sorted by (k, l, i, j), one per pixel, without zeros: equal counts have equal events."""
    flat = np.ravel_multi_index(pixels, grid.shape_KLHW)
    if n.all() and (np.diff(flat) > 0).all():  # as files and parts of other counts have them
        return _events_of(pixels, n)
    occupied, inverse = np.unique(flat, return_inverse=True)
    photons = np.zeros(occupied.size, dtype=np.int64)
    np.add.at(photons, inverse, n)
    occupied, photons = occupied[photons > 0], photons[photons > 0]
    return _events_of(np.unravel_index(occupied, grid.shape_KLHW), photons)


def _sorted_frames(
    pixels: tuple[np.ndarray, ...], n: np.ndarray, frame: np.ndarray, grid: CameraGrid, readout: Readout
) -> np.ndarray:
    """Frame of each count of pixels that have `n`, in the order of their `_sorted_events`, (sum n,) int32.

    Frames of a pixel are in their order. Raises `InputError` for a list of another length, a frame outside
    the exposure, and more counts in one than it holds.
    """
    if frame.shape != (int(n.sum()),):
        raise InputError(f"frame: expected one for each of {int(n.sum())} counts, got {frame.shape}")
    if frame.size and frame.max() >= readout.frames:
        raise InputError(f"frame: {frame.max()} is outside 0 .. {readout.frames - 1}")
    flat = np.ravel_multi_index(pixels, grid.shape_KLHW).repeat(n)
    frame = frame.astype(np.int32)
    step = np.diff(flat)
    if not ((step > 0) | (step == 0) & (np.diff(frame) >= 0)).all():
        order = np.lexsort((frame, flat))
        flat, frame = flat[order], frame[order]
    most = readout.most_per_frame
    if most is not None and most < frame.size:
        again = (flat[most:] == flat[:-most]) & (frame[most:] == frame[:-most])
        if again.any():
            raise InputError(f"frame: a pixel has more counts in frame {frame[most:][again][0]} than {most}")
    return read_only(frame)


@dataclass(frozen=True, eq=False, repr=False)
class PhotonCounts(Plottable):
    """Photon counts of every elemental image, as sparse events or as a dense stack, without ground truth.

    Make it with `from_dense` or `from_events`. `cfa` is the Bayer pattern, None for monochrome; `readout` the
    frames in which a single-photon camera counted, of whose counts these are the sums; `frame` (photons,), if
    it is known, is the frame of each single count, in the order of the events.
    """

    grid: CameraGrid
    cfa: str | None
    _events: PhotonEvents | None = field(default=None, repr=False)
    _dense: np.ndarray | None = field(default=None, repr=False)
    readout: Readout = PLAIN
    frame: np.ndarray | None = None

    @classmethod
    def from_dense(
        cls,
        counts_KLHW: np.ndarray,
        grid: CameraGrid,
        *,
        cfa: str | None = None,
        frames: int = 1,
        bits: int | None = None,
    ) -> "PhotonCounts":
        """Counts from a copy of a dense stack (K, L, H, W) of whole numbers >= 0.

        They are the sums of `frames`, each of which counts to 2^`bits` - 1, or without limit. Raises
        `InputError` for another shape, and for negative, fractional or too large counts.

        >>> grid = CameraGrid(rows=1, cols=2, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.05, height=4, width=6)
        >>> PhotonCounts.from_dense(np.ones((1, 2, 4, 6), dtype=np.uint16), grid, cfa="GRBG")
        PhotonCounts(shape=1 x 2 x 4 x 6, cfa=GRBG, photons=48, storage=dense)
        """
        _check_sensor(grid, cfa)
        counts = whole_counts("counts", counts_KLHW)
        if counts.shape != grid.shape_KLHW:
            raise InputError(f"counts: expected shape {grid.shape_KLHW}, got {counts.shape}")
        readout = Readout(frames, bits)
        readout.check(counts)
        copy = counts.copy() if np.may_share_memory(counts, counts_KLHW) else counts
        return cls(grid, cfa, _dense=read_only(copy), readout=readout)

    @classmethod
    def from_events(
        cls,
        k: np.ndarray,
        l: np.ndarray,
        i: np.ndarray,
        j: np.ndarray,
        n: np.ndarray,
        grid: CameraGrid,
        *,
        cfa: str | None = None,
        frames: int = 1,
        bits: int | None = None,
        frame: np.ndarray | None = None,
    ) -> "PhotonCounts":
        """Counts from five equal-length lists: camera (k, l), pixel (i, j), photons n.

        A pixel may appear more than once; its photons add up, over `frames` of `bits` as in `from_dense`.
        `frame`, if known, is that of each single count, from 0: of the first `n`, then of the next. Raises
        `InputError` for an index outside the grid, a negative, fractional or too large count, or lists of
        different lengths.

        >>> grid = CameraGrid(rows=1, cols=2, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.05, height=4, width=6)
        >>> counts = PhotonCounts.from_events([0, 0], [0, 1], [3, 3], [5, 4], [1, 2], grid)
        >>> counts.total, counts.view(0, 1)[3].tolist()
        (3, [0, 0, 0, 0, 2, 0])
        """
        _check_sensor(grid, cfa)
        columns: list[np.ndarray] = []
        for name, values, size in zip("klij", (k, l, i, j), grid.shape_KLHW, strict=True):
            column = whole_counts(name, np.atleast_1d(values))
            if column.ndim != 1:
                raise InputError(f"{name}: expected a one-dimensional list")
            if column.size and column.max() >= size:
                raise InputError(f"{name}: index {column.max()} is outside 0 .. {size - 1}")
            columns.append(column.astype(np.int32))
        pixels = tuple(columns)
        photons = whole_counts("n", np.atleast_1d(n)).astype(np.int64)
        if len({column.shape for column in (*pixels, photons)}) != 1:
            raise InputError("k, l, i, j, n: the five lists must have the same length")
        readout = Readout(frames, bits)
        events = _sorted_events(pixels, photons, grid)
        whole_counts("n", events.n)  # after those of one pixel are added up
        readout.check(events.n)
        if frame is not None:
            frame = _sorted_frames(pixels, photons, whole_counts("frame", frame), grid, readout)
        return cls(grid, cfa, _events=events, readout=readout, frame=frame)

    def _facts(self) -> dict[str, object]:
        return {
            "shape": times(self.grid.shape_KLHW),
            "cfa": self.cfa or "mono",
            "photons": self.total,
            "frames": None if self.readout.is_plain else self.readout.frames,
            "bits": self.readout.bits,
            "storage": "events" if self.is_sparse else "dense",
        }

    @property
    def is_sparse(self) -> bool:
        """Whether the counts are kept as events."""
        return self._events is not None

    @property
    def dense(self) -> np.ndarray:
        """The dense stack of counts (K, L, H, W); of events it is made at each call, int32 if they fit."""
        if self._dense is not None:
            return self._dense
        events = self.events
        dtype = np.int32 if events.n.max(initial=0) < 1 << 31 else np.int64  # signed: differences do not wrap
        dense = np.zeros(self.grid.shape_KLHW, dtype)
        dense[events.k, events.l, events.i, events.j] = events.n
        return dense

    @cached_property
    def occupied_share(self) -> float:
        """Share of the pixels that have photons."""
        occupied = self.events.n.size if self._dense is None else int(np.count_nonzero(self._dense))
        return occupied / math.prod(self.grid.shape_KLHW)

    @cached_property
    def events(self) -> PhotonEvents:
        """The counts as events, one per pixel with photons, in (k, l, i, j) order."""
        if self._events is not None:
            return self._events
        assert self._dense is not None
        pixels = np.nonzero(self._dense)
        return _events_of(pixels, self._dense[pixels].astype(np.int64))

    @cached_property
    def frame_events(self) -> FrameEvents | None:
        """Each single count with its frame, in the order of `events`; None if the frames were not kept."""
        if self.frame is None and self.readout.frames > 1:
            return None
        e = self.events
        frame = np.zeros(self.total, np.int32) if self.frame is None else self.frame
        k, l, i, j = (read_only(index.repeat(e.n)) for index in (e.k, e.l, e.i, e.j))
        return FrameEvents(k, l, i, j, read_only(frame))

    @cached_property
    def event_colours(self) -> np.ndarray:
        """Colour of the pixel of each event, int64: 0, 1, 2 = R, G, B; 0 for monochrome."""
        return read_only(colour_cells(self.cfa)[self.events.i % 2, self.events.j % 2])

    @cached_property
    def view_starts(self) -> np.ndarray:
        """Index of the first event of each view k L + l, then the number of events; (K L + 1,) int64."""
        view = self.events.k.astype(np.int64) * self.grid.cols + self.events.l
        return read_only(np.searchsorted(view, np.arange(self.grid.view_count + 1)))

    def view(self, k: int, l: int) -> np.ndarray:
        """Dense counts (H, W) of camera (k, l); raises `InputError` for a camera outside the grid."""
        self.grid.check_camera(k, l)
        if self._dense is not None:
            return self._dense[k, l]
        events = self.events
        image = np.zeros(self.grid.shape_HW, dtype=np.int64)
        number = k * self.grid.cols + l
        view_events = slice(self.view_starts[number], self.view_starts[number + 1])
        image[events.i[view_events], events.j[view_events]] = events.n[view_events]
        return image

    def rate(self, k: int, l: int, frames: tuple[int, int] | None = None) -> np.ndarray:
        """Photons per pixel and frame of camera (k, l), estimated from some frames, (H, W) float64.

        `frames` is (first, end), of which `end` is left out; by default all frames. Of S counts in F frames
        it is -ln(1 - S / F) for one bit, S / F without a limit, and for more bits as in `Readout.photons`; it
        is infinite where all F frames are full. Raises `InputError` for a camera outside the grid, for frames
        outside the exposure, and for a part of them where only the sums over all were stored.

        >>> grid = CameraGrid(rows=1, cols=1, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.05, height=1, width=2)
        >>> pixels = dict(k=[0, 0], l=[0, 0], i=[0, 0], j=[0, 1], n=[1, 2])
        >>> counts = PhotonCounts.from_events(**pixels, grid=grid, frames=4, bits=1, frame=[3, 0, 1])
        >>> counts.rate(0, 0).round(3).tolist(), counts.rate(0, 0, frames=(0, 2)).tolist()
        ([[0.288, 0.693]], [[0.0, inf]])
        """
        image, number = self.view(k, l), self.readout.frames
        match (0, number) if frames is None else frames:
            case (first, end) if is_whole(first) and is_whole(end) and 0 <= first < end <= number:
                pass
            case _:
                expected = f"(first, end), 0 <= first < end <= {number}"
                raise InputError(f"frames: expected {expected}, got {frames!r}")
        if end - first < number:
            if self.frame is None:
                raise InputError(f"frames: only the sums over all {number} frames were stored")
            before = self.events.n[: self.view_starts[k * self.grid.cols + l]].sum()
            in_range = self.frame[before : before + image.sum()]
            pixels = np.arange(image.size).repeat(image.ravel())
            pixels = pixels[(first <= in_range) & (in_range < end)]
            image = np.bincount(pixels, minlength=image.size).reshape(image.shape)
        readout = Readout(end - first, self.readout.bits)
        return readout.photons(image, np.ones_like(image)) / readout.frames

    @cached_property
    def total(self) -> int:
        """Number of photons of all views."""
        if self._dense is not None:
            return int(self._dense.sum(dtype=np.int64))
        return int(self.events.n.sum())

    @property
    def channel_count(self) -> int:
        """Number of colours of sections of these counts: 3, or 1 for monochrome."""
        return channel_count(self.cfa)

    def subsample(self, most: float, rng: np.random.Generator) -> "PhotonCounts":
        """Counts of about `most` photons, each photon kept with the same probability.

        The number of photons kept is binomial with mean `most`; Poisson counts stay Poisson counts. Counts of
        no more than `most` photons are returned as they are. Raises `InputError` if `most` is not a number
        of at least 0.
        """
        if not most >= 0:
            raise InputError(f"most: expected a number of photons of at least 0, got {most!r}")
        if self.total <= most:
            return self
        events, frame = self.events, None
        if self.frame is None:
            n = rng.binomial(events.n, most / self.total)
        else:
            is_sampled = rng.random(self.total) < most / self.total
            event = np.arange(events.n.size).repeat(events.n)
            n = np.bincount(event[is_sampled], minlength=events.n.size)
            frame = read_only(self.frame[is_sampled])
        lit = n > 0
        events = _events_of((events.k[lit], events.l[lit], events.i[lit], events.j[lit]), n[lit])
        return PhotonCounts(self.grid, self.cfa, _events=events, readout=self.readout, frame=frame)


def _check_sensor(grid: object, cfa: str | None) -> None:
    if not isinstance(grid, CameraGrid):
        raise InputError(f"grid: expected a CameraGrid, got {type(grid).__name__}")
    check_cfa(cfa)

"""Sections of a textured plane: time against error, ours and other packages' on the same views.

100 views of the plane, whose views and truth are known in closed form. Other packages get what suits them:
single precision images in memory, one channel, mean alone.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.figures import curve, frame
from benchmarks.machine import has
from benchmarks.peers.shifted_means import by_opencv, by_scipy, by_slices
from benchmarks.results import Measured, Row, Size, Study, Value, mean_of
from benchmarks.timing import median_of, side_by_side
from pcii.sections import demosaic, reconstruct
from pcii.types import CameraGrid, PhotonCounts, Views, mosaic

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CFA = "GRBG"
CONTRAST = 0.15
"""Standard deviation of the texture, about a mean of 0.5."""
BORDER_PX = 80
SHOWN_PX = 13.3
"""The disparity that is drawn and read, which is neither whole nor half."""
BLOCKS = 4
"""A section is divided into `BLOCKS` x `BLOCKS` blocks; the spread of their errors gives the interval."""
PLANE_MM = 1.0
ONE_COLOUR = "Sections of one colour"
THREE_COLOURS = "Sections of three colours from mosaics"
BY_PHOTONS = "Sections of photon counts"
Way = Callable[[], np.ndarray]


SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {"side_px": 256, "repeats": 6, "disparities": (13.0, 13.3), "budgets": (1e3, 1e4, 1e5)},
    "full": {
        "side_px": 512,
        "repeats": 12,
        "disparities": (13.0, 13.15, 13.3, 13.5),
        "budgets": (1e3, 1e4, 1e5, 1e6),
    },
}


class Texture:
    """Colours of a plane as the virtual centre sees them: waves whose strength falls with frequency."""

    def __init__(self, waves: int = 200, highest_per_px: float = 0.4) -> None:
        rng = np.random.default_rng(0)
        frequency = np.exp(rng.uniform(np.log(0.004), np.log(highest_per_px), waves))
        turn = rng.uniform(0, 2 * np.pi, waves)
        self.across, self.down = frequency * np.cos(turn), frequency * np.sin(turn)
        self.phase = rng.uniform(0, 2 * np.pi, waves)
        # Colours go together as those of most things do.
        self.strength = rng.normal(size=(waves, 1)) + 0.4 * rng.normal(size=(waves, 3))
        self.strength *= frequency[:, None] ** -0.5
        # A pixel sees the mean over its square.
        self.strength *= (np.sinc(self.across) * np.sinc(self.down))[:, None]
        self.strength *= CONTRAST / np.sqrt((self.strength**2).sum(axis=0) / 2)

    def seen_at(self, row_px: np.ndarray, col_px: np.ndarray) -> np.ndarray:
        """What pixels about these rows (H,) and columns (W,) see: (H, W, 3), mean 0.5."""
        down = np.exp(2j * np.pi * np.outer(row_px, self.down) + 1j * self.phase)
        across = np.exp(2j * np.pi * np.outer(col_px, self.across))
        colours = [((down * strength) @ across.T).real for strength in self.strength.T]
        return 0.5 + np.stack(colours, axis=-1)


def plane_views(
    texture: Texture, disparity_px: float, side_px: int, cfas: Sequence[str | None]
) -> list[Views]:
    """100 images of the plane of this disparity at 1 mm: mosaics for each pattern, its green for None."""
    grid = CameraGrid(
        rows=10,
        cols=10,
        pitch_mm=(disparity_px, disparity_px),
        focal_mm=1.0,
        pixel_mm=1.0,
        height=side_px,
        width=side_px,
    )
    pixels, images = np.arange(side_px), np.empty((len(cfas), *grid.shape_KLHW, 1), dtype=np.float32)
    for k, l in np.ndindex(10, 10):
        picture = texture.seen_at(pixels + (k - 4.5) * disparity_px, pixels + (l - 4.5) * disparity_px)
        for image, cfa in zip(images, cfas, strict=True):
            image[k, l, ..., 0] = picture[..., 1] if cfa is None else mosaic(picture, cfa)
    return [Views(image, grid, cfa) for image, cfa in zip(images, cfas, strict=True)]


def measure(side_px: int, repeats: int, disparities: Sequence[float], budgets: Sequence[float]) -> Measured:
    """Every way on the same views, of planes of these disparities in px."""
    texture, rows = Texture(), list[Row]()
    for disparity in disparities:
        plain, bayer = plane_views(texture, disparity, side_px, (None, CFA))
        truths = {M: texture.seen_at(*[_centres(side_px, M)] * 2) for M in (1, 2, 4)}
        green = {M: truth[..., 1:2] for M, truth in truths.items()}
        rows += _rows(ONE_COLOUR, _plain_ways(plain), green, disparity, repeats)
        rows += _rows(THREE_COLOURS, _bayer_ways(bayer), truths, disparity, repeats)
    rows += _photon_rows(texture, side_px, budgets, repeats)
    return Measured(rows, seeds=list(range(1, repeats + 1)))


def _plain_ways(views: Views) -> dict[str, Way]:
    images, grid = np.asarray(views.radiance)[..., 0], views.grid
    ways: dict[str, Way] = {
        "nearest": lambda: _estimate(views),
        "2 x 2 subpixels": lambda: _estimate(views, subpixel=2),
        "4 x 4 subpixels": lambda: _estimate(views, subpixel=4),
        "SciPy, bilinear": lambda: by_scipy(images, grid, PLANE_MM)[..., None],
        "SciPy, cubic": lambda: by_scipy(images, grid, PLANE_MM, order=3)[..., None],
        "NumPy slices": lambda: by_slices(images, grid, PLANE_MM)[..., None],
    }
    if has("opencv-python-headless"):
        ways["OpenCV, bilinear"] = lambda: by_opencv(images, grid, PLANE_MM)[..., None]
    return ways


def _bayer_ways(views: Views) -> dict[str, Way]:
    return {
        "nearest": lambda: _estimate(views),
        "2 x 2 subpixels": lambda: _estimate(views, subpixel=2),
        "4 x 4 subpixels": lambda: _estimate(views, subpixel=4),
        "even, then Laroche-Prescott": lambda: _estimate(views, shifts="even"),
    }


def _estimate(data: Views | PhotonCounts, **options: Any) -> np.ndarray:
    """The section's mean (H M, W M, C), NaN where no sample is."""
    sections = reconstruct(data, PLANE_MM, **options)
    if sections.cfa is not None:
        return demosaic(sections.estimate[0, ..., 0], cfa=sections.cfa)
    return np.where(sections.coverage[0] > 0, sections.estimate[0], np.nan)


def _rows(
    table: str, ways: dict[str, Way], truths: dict[int, np.ndarray], disparity: float, repeats: int
) -> list[Row]:
    seconds = side_by_side({name: lambda _, way=way: way() for name, way in ways.items()}, repeats)
    rows: list[Row] = []
    for name, way in ways.items():
        section = way()
        M = section.shape[0] // truths[1].shape[0]
        values = {"time_ms": median_of(seconds[name], 1e3)} | errors(section, truths[M], BORDER_PX * M)
        rows.append(Row(table, name, {"disparity_px": disparity}, values))
    return rows


def errors(found: np.ndarray, truth: np.ndarray, border_px: int) -> dict[str, Value]:
    """RMS error inside the border in percent of the contrast, and the share of voxels that have a value."""
    inner = slice(border_px, -border_px)
    difference = (found - truth)[inner, inner]
    blocks = [
        part for band in np.array_split(difference, BLOCKS) for part in np.array_split(band, BLOCKS, axis=1)
    ]
    rms = [100 / CONTRAST * float(np.sqrt(np.nanmean(block**2))) for block in blocks]
    covered = 100 * float(np.isfinite(difference).mean())
    return {"rmse_percent": mean_of(rms), "covered_percent": Value(covered)}


def _centres(side_px: int, M: int) -> np.ndarray:
    """Places of fine voxels in pixels."""
    return (np.arange(side_px * M) + 0.5) / M - 0.5


def _photon_rows(texture: Texture, side_px: int, budgets: Sequence[float], repeats: int) -> list[Row]:
    """Errors of sections from events follow from the photons, and nothing is sharper than they are."""
    (views,), rows = plane_views(texture, SHOWN_PX, side_px, [None]), list[Row]()
    rates = np.asarray(views.radiance)[..., 0].astype(np.float64)
    truth = texture.seen_at(*[_centres(side_px, 1)] * 2)[..., 1:2]
    for budget in budgets:
        scale = budget / (0.5 * side_px**2)
        seconds, error = [], []
        for seed in range(repeats):
            images = np.random.default_rng(seed).poisson(scale * rates)
            k, l, i, j = np.nonzero(images)
            counts = PhotonCounts.from_events(k, l, i, j, images[k, l, i, j], views.grid)
            taken = side_by_side({"events": lambda _, counts=counts: _estimate(counts)}, 1)
            seconds += taken["events"]
            section = _estimate(counts) / scale
            error.append(errors(section, truth, BORDER_PX)["rmse_percent"].value)
        values = {"time_ms": median_of(seconds, 1e3), "rmse_percent": mean_of(error)}
        rows.append(Row(BY_PHOTONS, "events", {"photons_per_view": budget}, values))
    return rows


def draw(figure: "Figure", measured: Measured) -> None:
    """Error against time: of one colour beside other packages, and of three colours."""
    left, middle, right = figure.subplots(1, 3)
    for axes, table, title in ((left, ONE_COLOUR, "one colour"), (middle, THREE_COLOURS, "three colours")):
        for number, row in enumerate(measured.of(table, disparity_px=SHOWN_PX)):
            curve(axes, [row], "time_ms", "rmse_percent", row.name, number)
        frame(axes, "time_ms", "rmse_percent", f"{title}, disparity {SHOWN_PX:g} px")
    curve(right, measured.of(BY_PHOTONS), "photons_per_view", "rmse_percent", "events", 0)
    frame(right, "photons_per_view", "rmse_percent", "photon counts")


def reading(measured: Measured) -> str:
    """How to read it, with figures of the plane of 13.3 px."""
    ours, peer = (
        measured.one(ONE_COLOUR, name, disparity_px=SHOWN_PX).values
        for name in ("nearest", "SciPy, bilinear")
    )
    whole = measured.one(ONE_COLOUR, "nearest", disparity_px=13.0).values
    few, *_, many = (row.values["rmse_percent"].value for row in measured.of(BY_PHOTONS))
    return (
        "Does interpolation pay? Further left and further down is better: with 100 cameras the roundings"
        f" of nearest shifts cancel, so that they have an error of {ours['rmse_percent'].value:.1f} % of the"
        f" texture's contrast in {ours['time_ms'].value:.1f} ms where bilinear ones by SciPy have"
        f" {peer['rmse_percent'].value:.1f} % in {peer['time_ms'].value:.0f} ms; at a whole disparity,"
        f" where all round alike, nearest shifts are off by {whole['rmse_percent'].value:.0f} %. Sections"
        f" of photon counts have errors of {few:.0f} % down to {many:.0f} % as photons grow, beside which"
        " those of shifts are small."
    )


STUDY = Study("sections", "Sections: error", SIZES, measure, draw, reading, width_in=12.0, height_in=4.2)

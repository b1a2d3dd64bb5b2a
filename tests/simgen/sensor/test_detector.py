"""What a sensor loses, adds and cuts off: exact small cases, and statistics whose planted fault is caught."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from photon_statistics import counted, has_mean, is_poisson
from scipy import stats

from pcii import Optics
from pcii.base import InputError
from pcii.types import CameraGrid, colour_index, mosaic
from simgen.dataset import dark_map, draw_counts
from simgen.sensor import PhotonTable, detect, full_light_image, no_photons, read_out
from simgen.spec import FullLight, Sensor

EFFICIENCY = (0.3, 0.6, 0.9)
NO_OBJECT = -1
COLUMNS = [field.name for field in fields(PhotonTable)]


def films(rows: int, cols: int, height: int, width: int) -> CameraGrid:
    return Optics(pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.1).grid((rows, cols, height, width))


GRID = films(2, 3, 50, 60)


def arriving(n: np.ndarray) -> PhotonTable:
    """Photons one by one, n (K, L, H, W) of them; all of object 1, at 600 mm."""
    where = np.nonzero(n)
    k, l, i, j = (index.repeat(n[where]) for index in where)
    ones = np.ones(k.size, dtype=np.int64)
    return PhotonTable(k, l, i, j, ones, 0 * ones, np.arange(k.size), ones, np.full(k.size, 600.0))


def poisson(rate: float | np.ndarray, seed: int, grid: CameraGrid = GRID) -> PhotonTable:
    return arriving(np.random.default_rng(seed).poisson(rate, grid.shape_KLHW))


DARKNESS = no_photons()


def detected(arrivals: PhotonTable, sensor: Sensor, seed: int) -> np.ndarray:
    """Counts per pixel of a sensor in colour, (K, L, H, W)."""
    return counted(detect(arrivals, GRID, "GRBG", sensor, seed), GRID)


@pytest.mark.parametrize("rate", [0.34, 1e-3])  # the paper's brightest pixels, and low light
def test_counts_have_mean_and_variance_of_their_rate(rate: float) -> None:
    counts = draw_counts(np.full((400, 500), rate), None, np.random.default_rng(3), None)
    assert is_poisson(counts, rate)
    assert not has_mean(2 * counts, rate)  # the fault of a well-known simulator at low light


def test_a_sensor_without_faults_changes_no_bit() -> None:
    arrivals = poisson(0.7, seed=1)
    counts = detect(arrivals, GRID, "GRBG", Sensor(), seed=1)
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(counts, name), getattr(arrivals, name))
    shares = ({name: 0.01} for name in ("dark_counts", "hot_pixel_share", "dead_pixel_share"))
    for fault in ({"quantum_efficiency": (1.0, 0.9, 1.0)}, *shares):
        assert (detected(arrivals, Sensor.model_validate(fault), 1) != counted(arrivals, GRID)).any()


@pytest.mark.parametrize("cfa", ["GRBG", None])
def test_each_colour_is_detected_with_its_efficiency_and_stays_poisson(cfa: str | None) -> None:
    sensor, arrivals = Sensor(quantum_efficiency=EFFICIENCY), poisson(2.0, seed=1)
    once = detect(arrivals, GRID, cfa, sensor, seed=2)
    twice = detect(once, GRID, cfa, sensor, seed=3)  # the fault: an efficiency that is applied twice
    # A monochrome sensor has the efficiency of green, 1.
    colours = colour_index(50, 60, cfa) if cfa else np.ones((50, 60), np.uint8)
    rounded = np.rint(np.array(EFFICIENCY)[colours] * counted(arrivals, GRID))  # the fault: no chance in it
    for colour in np.unique(colours):
        rate, here = 2.0 * EFFICIENCY[colour], colours == colour
        assert is_poisson(counted(once, GRID)[..., here], rate)
        assert not is_poisson(counted(twice, GRID)[..., here], rate)
        assert not is_poisson(rounded[..., here], rate)


def test_photons_that_come_in_numbers_are_detected_one_by_one() -> None:
    one_by_one = poisson(2.0, seed=4)
    n = counted(one_by_one, GRID)
    where = np.nonzero(n)
    sensor = Sensor(quantum_efficiency=(0.6, 0.6, 0.6))
    found = detected(PhotonTable(*where, n[where]), sensor, seed=5)
    assert is_poisson(found, 1.2)
    assert (found <= n).all()
    whole = n * (np.random.default_rng(5).random(n.shape) < 0.6)  # the fault: all of a pixel's or none
    assert not is_poisson(whole, 1.2)


def test_dark_counts_are_poisson_everywhere_and_come_on_top_of_photons() -> None:
    dark: Any = detect(DARKNESS, GRID, "GRBG", Sensor(dark_counts=0.5), seed=1)
    counts = counted(dark, GRID)
    assert is_poisson(counts, 0.5)
    assert not has_mean(2 * counts, 0.5)
    for lines in (counts.sum(axis=(0, 1, 2)), counts.sum(axis=(0, 1, 3)), counts.sum(axis=(2, 3)).ravel()):
        assert stats.chisquare(lines).pvalue > 1e-3
        tilted = lines * np.linspace(0.8, 1.2, lines.size)  # the fault: more of them towards one side
        assert stats.chisquare(tilted).pvalue < 1e-3
    assert (dark.object_id == NO_OBJECT).all()
    assert np.isinf(dark.columns()["z_mm"]).all()
    assert (dark.rank == -1).all()
    arrivals = poisson(0.5, seed=2)
    both = detect(arrivals, GRID, "GRBG", Sensor(dark_counts=0.2), seed=3)
    photons = both.take(both.columns()["object_id"] != NO_OBJECT)
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(photons, name), getattr(arrivals, name))
    assert is_poisson(counted(both, GRID), 0.7)
    assert not is_poisson(counted(photons, GRID), 0.7)  # the fault: they take the place of photons


def test_hot_pixels_are_the_same_in_every_view() -> None:
    sensor = Sensor(hot_pixel_share=0.01, hot_pixel_counts=50.0)
    counts = detected(DARKNESS, sensor, seed=1)
    hot = counts > 0  # a Poisson number of mean 50 is 0 once in 1e21
    assert hot[0, 0].sum() == round(0.01 * 50 * 60)
    assert (hot == hot[0, 0]).all()
    assert is_poisson(counts[hot], 50.0)
    assert (counts[0, 0] != counts[1, 2]).any()  # the pixels are the same, their counts are not
    another = detected(DARKNESS, sensor, seed=2) > 0
    assert (another != hot[0, 0]).any(axis=(2, 3)).all()  # the fault: every view has its own


def departs(counts: np.ndarray, means: np.ndarray) -> bool:
    """Whether these are no Poisson numbers of these means, by 5 standard errors of their mean square."""
    errors = np.sqrt((2 + 1 / means).sum())
    return bool(abs(((counts - means) ** 2 / means - 1).sum()) > 5 * errors)


@pytest.mark.parametrize("is_of_each_camera", [True, False])
def test_a_map_of_dark_counts_is_drawn_pixel_by_pixel(is_of_each_camera: bool, tmp_path: Path) -> None:
    """Of a median of 1 count, and 3 % of the pixels 10 to 1000 times noisier."""
    grid, rng = films(2, 3, 40, 40), np.random.default_rng(1)
    shape = grid.shape_KLHW if is_of_each_camera else grid.shape_HW
    tail = np.where(rng.random(shape) < 0.03, 10 ** rng.uniform(1, 3, shape), 1.0)
    np.save(tmp_path / "map.npy", (rng.lognormal(0, 0.3, shape) * tail).astype(np.float32))
    sensor = Sensor(hot_pixels="map.npy", frames=50, bits=1)
    means: Any = dark_map(sensor, grid, tmp_path)
    dark = detect(no_photons(), grid, None, sensor, 1, means)
    counts, of_views = counted(dark, grid), np.broadcast_to(means, grid.shape_KLHW)
    sums, means_of_sums = counts.sum((0, 1)), of_views.sum((0, 1))
    assert not departs(counts, of_views)
    assert not departs(sums, means_of_sums)
    assert abs(sums.sum() - of_views.sum()) < 4 * np.sqrt(of_views.sum())
    assert departs(counts, of_views.swapaxes(2, 3))  # the fault: a map with rows for columns
    assert departs(6 * counts[0, 0], means_of_sums)  # the fault: one draw for all views
    assert (dark.columns()["object_id"] == NO_OBJECT).all()
    # In binary frames they stop as photons do: binomial, with a variance of at most 50 / 4.
    bits = counted(read_out(dark, grid, sensor, 2), grid)
    expected = 50 * -np.expm1(-of_views / 50)
    assert abs((bits - expected).mean()) < 4 * np.sqrt((expected * (1 - expected / 50)).mean() / bits.size)


MAP = np.zeros((50, 60))
OBJECTS = np.full((50, 60), None)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (MAP.T, r"map.npy: expected mean dark counts \(H, W\) = \(50, 60\), or .* got \(60, 50\)"),
        (MAP - 1e-9, "finite numbers from 0"),
        (MAP + np.nan, "finite numbers from 0"),
        (OBJECTS, "not an array of numbers in a .npy file"),  # which pickles would be read for
    ],
)
def test_a_map_that_is_none_is_refused(tmp_path: Path, values: np.ndarray, words: str) -> None:
    np.save(tmp_path / "map.npy", values)
    with pytest.raises(InputError, match=words):
        dark_map(Sensor(hot_pixels="map.npy"), GRID, tmp_path)
    (tmp_path / "below").mkdir()
    with pytest.raises(InputError, match=r"sensor.hot_pixels: '../map.npy' lies outside the folder"):
        dark_map(Sensor(hot_pixels="../map.npy"), GRID, tmp_path / "below")


def silent(counts: np.ndarray) -> np.ndarray:
    """Pixels (H, W) that count nothing in any view."""
    return counts.sum(axis=(0, 1)) == 0


def test_dead_pixels_never_count() -> None:
    dead = Sensor(dead_pixel_share=0.1, dark_counts=1.0, hot_pixel_share=0.3, hot_pixel_counts=9.0)
    arrivals = poisson(20.0, seed=1)
    counts = detected(arrivals, dead, seed=2)
    # A pixel that lives stays at 0 once in e^120.
    assert silent(counts).sum() == 300
    assert (silent(counts) == (counts[0, 0] == 0)).all()
    dark = detected(DARKNESS, Sensor(dark_counts=1.0), seed=3)
    assert silent(counts + dark).sum() < 30  # the fault: dark counts in dead pixels
    another = silent(detected(arrivals, dead, seed=4))
    assert (another != silent(counts)).any()
    both = Sensor(dead_pixel_share=0.5, hot_pixel_share=0.5, hot_pixel_counts=50.0)
    dark = detected(DARKNESS, both, seed=1)
    assert silent(dark).sum() == 1500  # others are dead than are hot


def companions(n: list[int]) -> PhotonTable:
    """In each of 4096 pixels some counts of each object, n[0] of object 1 and so on; in this order."""
    pixels = films(1, 1, 64, 64)
    flat, ids = np.arange(4096).repeat(len(n)), np.tile(np.arange(len(n)) + 1, 4096)
    k, l, i, j = np.unravel_index(flat, pixels.shape_KLHW)
    nobody = np.full(flat.size, -1)
    return PhotonTable(k, l, i, j, np.tile(n, 4096), nobody, nobody, ids, np.full(flat.size, 600.0))


@pytest.mark.parametrize(("n", "bits"), [([1, 1, 1], 1), ([2, 8], 2)])
def test_which_counts_a_counter_keeps_is_left_to_chance(n: list[int], bits: int) -> None:
    arrivals, pixels = companions(n), films(1, 1, 64, 64)
    kept: Any = read_out(arrivals, pixels, Sensor(bits=bits), seed=1)
    most, total = 2**bits - 1, sum(n)
    assert (counted(kept, pixels) == most).all()
    for number, count in enumerate(n, start=1):
        # Of a pixel's counts so many are drawn without putting any back: hypergeometric.
        mean = 4096 * most * count / total
        spread = np.sqrt(mean * (1 - count / total) * (total - most) / (total - 1))
        assert abs(kept.n[kept.object_id == number].sum() - mean) < 4 * spread
        first_in_the_list = 4096 * min(most, count)  # the fault: first come, first served
        assert number > 1 or abs(first_in_the_list - mean) > 4 * spread
    other: Any = read_out(arrivals, pixels, Sensor(bits=bits), seed=2)
    assert kept.object_id.tolist() != other.object_id.tolist()


GAIN, SIDE = 20.0, 200


def read_image(
    radiance: np.ndarray, light: FullLight, cfa: str | None = None, dark: Any = None, **sensor: object
) -> np.ndarray:
    settings = Sensor.model_validate({"full_light": light, **sensor})
    return full_light_image(radiance, cfa, GAIN, settings, np.random.default_rng(1), dark)


def even(value: float, channels: int = 1) -> np.ndarray:
    return np.full((SIDE, SIDE, channels), value, dtype=np.float32)


@pytest.mark.parametrize(
    ("cfa", "channels", "noise_e"), [("GRBG", 1, 2.0), ("GRBG", 3, 40.0), (None, 1, 40.0), (None, 3, 2.0)]
)
def test_mid_light_is_radiance_with_noise_of_electrons(
    cfa: str | None, channels: int, noise_e: float
) -> None:
    colours = np.array([30.0, 50.0, 70.0], dtype=np.float32)
    radiance = even(50.0) if channels == 1 else even(1.0, 3) * colours
    dark = np.tile([0.0, 0.0, 90.0, 90.0], (SIDE, SIDE // 4))
    image = read_image(
        radiance, FullLight(read_noise_e=noise_e), cfa, dark, quantum_efficiency=EFFICIENCY
    ).astype(np.float64)
    assert image.shape == radiance.shape
    efficiency = np.array(EFFICIENCY)
    if channels == 1:
        flat = np.broadcast_to(efficiency, (SIDE, SIDE, 3))
        efficiency = mosaic(flat, cfa)[..., None] if cfa else efficiency[1]
    gain = np.broadcast_to(efficiency * GAIN, image.shape)
    step_e = 10_000 / 4095
    electrons = image * gain
    expected = radiance * gain + dark[..., None]
    variance = expected + noise_e**2 + step_e**2 / 12
    for one in np.unique(expected):
        here = expected == one
        spread = np.sqrt(variance[here].mean() / here.sum())
        assert abs(electrons[here].mean() - one) < 4 * spread
        assert abs(image[here].mean() - one) > 4 * spread  # the fault: electrons, not radiance
        # Noise shows whose efficiency it was; the standard error of n nearly normal numbers' variance.
        ratio = electrons[here].var() / variance[here].mean()
        assert abs(ratio - 1) < 4 * np.sqrt(2 / here.sum())
    blind = read_image(radiance, FullLight(), cfa) * efficiency  # the fault: nobody makes up for the loss
    assert abs(blind.mean() / radiance.mean() - 1) > 0.05


def test_no_pixel_shows_more_than_its_full_well_or_less_than_nothing() -> None:
    bright = read_image(even(2000.0), FullLight(read_noise_e=0.0))
    np.testing.assert_allclose(bright, 10_000 / GAIN, rtol=1e-6)  # single precision
    noisy = read_image(even(2000.0), FullLight(read_noise_e=50.0))
    assert noisy.max() <= 10_000 / GAIN * (1 + 1e-6)
    # Reading noise comes after the well: half of the full pixels are read as less than full.
    assert abs((noisy < 10_000 / GAIN - 0.1).mean() - 0.5) < 0.05
    assert read_image(even(0.0), FullLight(read_noise_e=50.0)).min() == 0
    assert (read_image(even(0.0), FullLight(read_noise_e=0.0)) == 0).all()


def test_the_converter_takes_the_nearest_of_its_steps() -> None:
    # A well so deep that the photons' own noise, 1e-4 of it, is far less than a step of a seventh.
    light = FullLight(full_well_e=1e8, read_noise_e=0.0, adc_bits=3)
    share = (np.arange(0, 70) + 0.5) / 70  # of the well; all of them between two limits of steps
    radiance = (share * 1e8 / GAIN).astype(np.float32).reshape(1, 70, 1)
    steps = read_image(radiance, light) * GAIN / 1e8 * 7
    np.testing.assert_allclose(steps.ravel(), np.rint(7 * share), atol=1e-5)  # single precision
    assert np.unique(np.rint(steps)).tolist() == list(range(8))
    assert (np.floor(7 * share) != np.rint(7 * share)).any()  # the fault: the step below

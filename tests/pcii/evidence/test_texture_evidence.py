"""Evidence of texture: none of noise on average, and largest where texture is in focus."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from twins import even_light, unit_grid

from pcii.base import block_sums
from pcii.evidence import TextureModel, evidence_of_texture
from pcii.sections import reconstruct
from pcii.types import FocalPlanes


@pytest.mark.parametrize("octaves", [1, 4])
@pytest.mark.parametrize("rate", [0.05, 100.0])
@pytest.mark.parametrize("cfa", ["GRBG", None])
def test_noise_has_none_on_average(cfa: str | None, rate: float, octaves: int) -> None:
    grid = unit_grid(4, 4, 256, 256)
    # Where texture would stand far above the noise a coefficient has (y^2 / v - 1) / 2, of variance 1 / 2.
    model = TextureModel(contrast=1e3, averaging_error=0.0, saturation_nats=1e12, octaves=octaves)
    nats = evidence_of_texture(
        even_light(grid, rate, 3, cfa), FocalPlanes.at_depths(grid, [0.5]), model=model
    ).nats
    inner = nats[0, 16:-16, 16:-16]
    # The first octaves have as many independent coefficients as blocks, the others fewer.
    deviation = np.sqrt(sum(4.0**-octave / 2 for octave in range(octaves)) / inner.size)
    assert abs(inner.mean()) < 4 * deviation


def test_it_is_largest_in_focus_and_bounded(two_squares) -> None:
    planes = FocalPlanes.at_depths(two_squares.grid, [1 / d for d in (2.0, 2.5, 3.0, 3.5, 4.0)])
    nats = evidence_of_texture(two_squares.counts, planes).nats
    at_third = two_squares.masks[list(two_squares.z_mm).index(1 / 3)][::2, ::2]
    assert nats[:, at_third].sum(axis=1).argmax() == 2
    octaves = sum(4.0**-octave for octave in range(TextureModel().octaves))
    assert nats.max() <= TextureModel().saturation_nats * octaves


def test_two_octaves_are_those_of_the_equations() -> None:
    grid, model = unit_grid(3, 4, 67, 90), TextureModel(octaves=2, saturation_nats=1e12)
    counts = even_light(grid, 2.0, 5, "GRBG")
    planes = replace(FocalPlanes.at_depths(grid, [0.3, 0.8]), rounding=0.75)
    section = reconstruct(counts, planes)
    colours_apart = section.counts, section.coverage
    fine = [block_sums(part.sum(axis=-1, dtype=float), 2, float) for part in colours_apart]
    fine = [np.pad(part, [(0, 0), *((0, -size % 4) for size in part.shape[1:])]) for part in fine]
    impulse, expected = np.zeros((99, 99)), np.zeros(1)
    impulse[49, 49] = 1
    for octave, sigma in enumerate((1.0, 3**0.5)):
        coarse = [gaussian_filter(part, sigma, mode="constant", axes=(1, 2)) for part in fine]
        wider = gaussian_filter(impulse, sigma)
        y, b = (total / np.maximum(number, 1e-3) for total, number in (fine, coarse))
        v = ((impulse - wider) ** 2).sum() * coarse[0] / np.maximum(coarse[1], 1e-3) ** 2
        v = np.maximum(v, 1e-24) + (model.averaging_error * b) ** 2
        r = (model.contrast * b) ** 2 / v
        e = r / (1 + r) * ((y - b) ** 2 / v - 1) / 2
        expected = expected + np.where(coarse[1] >= model.least_coverage * 12 * 4, e, 0) / 4**octave
        fine, impulse = coarse, wider
    nats = evidence_of_texture(counts, planes, model=model).nats
    np.testing.assert_allclose(nats, expected[:, :34, :45], rtol=2e-4, atol=2e-6)


@pytest.mark.parametrize("octaves", [1, 4, 7])
@pytest.mark.parametrize("size", [(1, 1), (37, 50), (66, 23)])
def test_films_of_any_size_have_as_many_octaves_as_are_asked_for(size: tuple[int, int], octaves: int) -> None:
    grid = unit_grid(2, 3, *size)
    planes = FocalPlanes.at_depths(grid, [0.5, 1.0])
    nats = evidence_of_texture(
        even_light(grid, 1.0, 0, None), planes, model=TextureModel(octaves=octaves)
    ).nats
    assert nats.shape == (2, -(-size[0] // 2), -(-size[1] // 2))
    assert np.isfinite(nats).all()

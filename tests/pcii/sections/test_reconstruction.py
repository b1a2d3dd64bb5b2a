import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twins import blocky_texture, section_twin, unit_grid

import pcii
from pcii.sections import reconstruct
from pcii.types import PATTERNS, CameraGrid, PhotonCounts, Views, mosaic

patterns = st.sampled_from([*PATTERNS, None])
# Depths whose disparity is exact, so that the twin's order of operations cannot matter.
depths = st.lists(st.sampled_from([0.25, 0.5, 1.0, 2.0, 4.0]), min_size=1, max_size=2)
grids = st.builds(
    unit_grid,
    st.integers(1, 4),
    st.integers(1, 4),
    st.integers(1, 6),
    st.integers(1, 6),
    st.tuples(st.floats(0.01, 4), st.floats(0.01, 4)),
)


def random_counts(grid: CameraGrid, seed: int, rate: float = 2.0) -> np.ndarray:
    return np.random.default_rng(seed).poisson(rate, size=grid.shape_KLHW)


def photons(dense: np.ndarray, grid: CameraGrid, cfa: str | None = None) -> PhotonCounts:
    return PhotonCounts.from_dense(dense, grid, cfa=cfa)


@given(grid=grids, cfa=patterns, z=depths, subpixel=st.integers(1, 3), seed=st.integers(0, 999))
def test_sections_are_eq_3_to_the_bit(grid, cfa, z, subpixel, seed):
    dense = random_counts(grid, seed)
    sections = reconstruct(photons(dense, grid, cfa), z, subpixel=subpixel)
    # Whole numbers of radiance have exact float64 sums.
    views = reconstruct(Views(dense[..., None].astype(float), grid, cfa), z, subpixel=subpixel)
    total, coverage = section_twin(dense, grid, cfa, z, subpixel)
    for each in (sections, views):
        np.testing.assert_array_equal(each.counts, total)
        np.testing.assert_array_equal(each.coverage, coverage)
    assert sections.counts.dtype.kind == "i"
    mean = [t / c if c else 0.0 for t, c in zip(total.ravel(), coverage.ravel(), strict=True)]
    np.testing.assert_array_equal(sections.estimate.ravel(), mean)


def test_the_view_from_the_right_moves_right_by_hand():
    grid = unit_grid(1, 2, 1, 4, pitch_mm=(2.0, 1.0))  # at z = 1 the shifts are -1 and +1
    dense = np.array([[[[0, 1, 2, 3]], [[4, 5, 6, 7]]]])
    sections = reconstruct(photons(dense, grid), 1.0)
    assert sections.counts[0, 0, :, 0].tolist() == [1, 2 + 4, 3 + 5, 6]
    assert sections.coverage[0, 0, :, 0].tolist() == [1, 2, 2, 1]
    assert sections.estimate[0, 0, :, 0].tolist() == [1.0, 3.0, 4.0, 6.0]


def test_colours_never_mix_by_hand():
    grid = unit_grid(1, 2, 1, 4, pitch_mm=(2.0, 1.0))  # odd shifts: green falls on red
    dense = np.array([[[[1, 10, 2, 20]], [[3, 30, 4, 40]]]])  # G R G R
    red, green, blue = np.moveaxis(reconstruct(photons(dense, grid, "GRBG"), 1.0).counts[0, 0], -1, 0)
    assert red.tolist() == [10, 0, 20 + 30, 0]
    assert green.tolist() == [0, 2 + 3, 0, 4]
    assert blue.tolist() == [0, 0, 0, 0]


def views_of_a_plane(
    grid: CameraGrid, disparity_px: tuple[int, int], seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Crops (K, L, H, W, 3) of one large picture, and what the virtual centre sees of it (H, W, 3)."""
    K, L, H, W = grid.shape_KLHW
    margin = 32
    picture = np.random.default_rng(seed).integers(0, 256, size=(H + 2 * margin, W + 2 * margin, 3))

    def crop(k: float, l: float) -> np.ndarray:
        # A camera further right has a field of view further right.
        top = margin + int((k - (K - 1) / 2) * disparity_px[1])
        left = margin + int((l - (L - 1) / 2) * disparity_px[0])
        return picture[top : top + H, left : left + W]

    views = np.array([[crop(k, l) for l in range(L)] for k in range(K)])
    return views.astype(float), crop((K - 1) / 2, (L - 1) / 2)


@pytest.mark.parametrize("cfa", ["GRBG", "BGGR", None])
@pytest.mark.parametrize(
    ("shape", "parallax", "shear"),
    [
        ((3, 5, 20, 21), (3, 2), (0, 0)),
        ((4, 2, 21, 20), (6, 2), (0, 0)),
        ((3, 5, 20, 21), (3, 2), (3, 2)),  # the plane stands still
        ((3, 5, 20, 21), (3, 2), (5, 7)),  # and is turned round
    ],
)
def test_a_plane_is_exact_at_its_depth_and_nowhere_else(cfa, shape, parallax, shear):
    pitch = (float(parallax[0]), float(parallax[1]))
    grid = unit_grid(*shape, pitch_mm=pitch, shear_px=shear)
    images, pattern = views_of_a_plane(grid, (parallax[0] - shear[0], parallax[1] - shear[1]), seed=3)
    views = Views(images, grid) if cfa is None else Views(mosaic(images, cfa)[..., None], grid, cfa)
    sections = reconstruct(views, [1.0, 0.25, 2.0])
    covered = sections.coverage > 0
    np.testing.assert_array_equal(sections.estimate[0], np.where(covered[0], pattern, 0))
    assert covered[0].any(axis=-1).mean() > 0.5
    # The mean of at least two unrelated bytes is rarely the right byte.
    assert (sections.estimate[1] != pattern)[sections.coverage[1] > 1].mean() > 0.9
    if any(shear):  # the fault: the same views taken for those of a grid that is not sheared
        fault = reconstruct(Views(views.radiance, unit_grid(*shape, pitch_mm=pitch), cfa), 1.0)
        assert (fault.estimate[0] != pattern)[fault.coverage[0] > 1].mean() > 0.5
    else:
        assert (sections.estimate[2] != pattern)[sections.coverage[2] > 1].mean() > 0.9


def test_views_on_disk_are_read_once_however_many_planes(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = unit_grid(2, 3, 16, 16)
    pixels = blocky_texture(np.random.default_rng(0), 16, 16)
    reads: list[tuple[int, int]] = []

    class Reader:
        shape = (*grid.shape_KLHW, 3)

        def __getitem__(self, index: tuple[int, int]) -> np.ndarray:
            reads.append(index)
            return pixels

    on_disk, everything = Views(Reader(), grid), Views(np.tile(pixels, (2, 3, 1, 1, 1)), grid)
    cameras = [(k, l) for k in range(2) for l in range(3)]
    sections = reconstruct(on_disk, [1.0, 2.0, 4.0])
    assert sorted(reads) == cameras
    np.testing.assert_array_equal(sections.counts, reconstruct(everything, [1.0, 2.0, 4.0]).counts)

    reads.clear()
    depth = pcii.estimate_depth(on_disk, (0.25, 2.0))
    assert sorted(reads) == cameras
    monkeypatch.setattr("pcii.sections.dense_sections.MOST_BYTES", 0)  # too many for the memory
    again = pcii.estimate_depth(on_disk, (0.25, 2.0))
    assert len(reads) > 10 * len(cameras)
    for own in (again, pcii.estimate_depth(everything, (0.25, 2.0))):
        np.testing.assert_allclose(depth.z_mm, own.z_mm, rtol=1e-6)

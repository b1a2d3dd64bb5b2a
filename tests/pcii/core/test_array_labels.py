"""Types as datasets of xarray: values untouched, axes named as in files, coordinates as the optics say."""

import json
import sys
from collections.abc import Mapping
from dataclasses import asdict

import numpy as np
import pytest
import xarray
from stored_datasets import make_dataset
from twins import unit_grid

import pcii
from pcii.core.geometry import camera_position_mm
from pcii.core.truth import Truth

GRID = unit_grid(2, 3, 4, 6, pitch_mm=(3.0, 5.0), shear_px=(0.5, 0.0))
DENSE = np.random.default_rng(2).poisson(1, GRID.shape_KLHW)


def check(dataset: xarray.Dataset, dims: Mapping[str, tuple[str, ...]]) -> None:
    """Names and axes of all variables; each has a unit and a meaning; attributes are such as files hold."""
    assert {name: array.dims for name, array in dataset.data_vars.items()} == dict(dims)
    assert all({"units", "long_name"} <= set(array.attrs) for array in dataset.data_vars.values())
    for array in (dataset, *dataset.variables.values()):
        json.dumps(array.attrs)
        assert None not in array.attrs.values()


def from_events(cfa: str | None) -> pcii.PhotonCounts:
    k, l, i, j = np.nonzero(DENSE)
    return pcii.PhotonCounts.from_events(k, l, i, j, DENSE[k, l, i, j], GRID, cfa=cfa)


@pytest.mark.parametrize(
    "counts", [pcii.PhotonCounts.from_dense(DENSE, GRID, cfa="GRBG"), from_events("GRBG")]
)
def test_counts_have_cameras_and_pixels(counts: pcii.PhotonCounts):
    found = counts.to_xarray()
    check(found, {"dense": ("camera_row", "camera_col", "row", "col")})
    assert found.dense.attrs["units"] == "photons"
    assert from_events(None).to_xarray().attrs["cfa"] == "none"
    np.testing.assert_array_equal(found.dense.sel(camera_row=1, camera_col=2, row=3), DENSE[1, 2, 3])
    for k, l in np.ndindex(2, 3):
        place = found.camera_x_mm.sel(camera_col=l), found.camera_y_mm.sel(camera_row=k)
        assert tuple(map(float, place)) == camera_position_mm(GRID, k, l)
    assert (found.camera_x_mm.attrs["units"], found.row.attrs["units"]) == ("mm", "px")
    assert found.attrs["cfa"] == "GRBG"
    assert pcii.CameraGrid(**{name: found.attrs[name] for name in asdict(GRID)}) == GRID


def test_views_have_colours_and_may_be_on_disk(tmp_path):
    views = pcii.open_dataset(make_dataset(tmp_path / "data")).views
    assert views is not None
    found = views.to_xarray()
    check(found, {"radiance": ("camera_row", "camera_col", "row", "col", "channel")})
    assert float(found.radiance.sel(camera_row=1, camera_col=2, row=0, col=0, channel="B")) == 5.0


def test_sections_have_depths_and_centres_of_subpixels():
    counts = pcii.PhotonCounts.from_dense(DENSE, GRID, cfa="GRBG")
    sections = pcii.reconstruct(counts, z_mm=[1.0, 2.0, 4.0], subpixel=2)
    found = sections.to_xarray()
    dims = ("plane", "row", "col", "channel")
    check(found, dict.fromkeys(("counts", "coverage", "estimate"), dims))
    np.testing.assert_array_equal(found.z_mm, [1, 2, 4])
    assert (found.z_mm.dims, found.z_mm.attrs["units"]) == (("plane",), "mm")
    np.testing.assert_array_equal(found.row[:4], [-0.25, 0.25, 0.75, 1.25])
    np.testing.assert_array_equal(found.estimate.sel(plane=2, channel="G"), sections.estimate[1, ..., 1])
    assert found.counts.attrs["units"] == "photons"
    views = pcii.Views(np.ones((*GRID.shape_KLHW, 3)), GRID)
    of_light = pcii.reconstruct(views, z_mm=[1.0]).to_xarray()
    assert of_light.counts.attrs["units"] == "1"


def test_depth_maps_keep_what_is_unanswered():
    z_mm = np.array([[540.0, np.nan], [620.0, 540.0]])
    found = pcii.DepthMap(z_mm, np.isfinite(z_mm) * 0.9).to_xarray()
    check(found, dict.fromkeys(("z_mm", "confidence"), ("row", "col")))
    np.testing.assert_array_equal(found.z_mm, z_mm)


def test_truth_has_its_maps_its_photons_and_names_of_objects(tmp_path):
    truth = pcii.open_dataset(make_dataset(tmp_path / "data")).truth
    assert truth is not None
    assert truth.photons is not None
    found = truth.to_xarray()
    photons = {f"photon_{name}": ("photon",) for name in ("k", "l", "i", "j", "object_id", "z_mm")}
    check(found, dict.fromkeys(("z_mm", "object_id"), ("row", "col")) | photons)
    assert found.object_id.attrs["flag_values"] == [0, 1]
    assert found.object_id.attrs["flag_meanings"] == "none ball"
    np.testing.assert_array_equal(found.photon_l, truth.photons.l)
    normal = np.zeros((2, 2, 3), np.float32)
    z_mm, ids = np.full((2, 2), 5.0), np.full((2, 2), 3)
    named = Truth(z_mm, ids, {3: "toy bird"}, normal=normal).to_xarray()
    assert named.object_id.attrs["flag_meanings"] == "none toy_bird"
    assert named.normal.axis.values.tolist() == ["X", "Y", "Z"]


def test_without_xarray_a_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(pcii.InputError, match=r"to_xarray: needs the package xarray: pip install"):
        pcii.DepthMap(np.ones((1, 1)), np.ones((1, 1))).to_xarray()

"""Arrays in files of NumPy, MATLAB and HDF5, and maps of true depth beside pictures."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import OpenEXR
import pytest
from picture_folders import OPTICS, check_refused, run
from PIL import Image
from scipy.io import savemat

import pcii
from pcii import InputError
from pcii.metrics import depth_errors

VIEWS_KLHW = np.random.default_rng(3).random((3, 3, 20, 24)).astype(np.float32)
HWKL = np.ascontiguousarray(VIEWS_KLHW.transpose(2, 3, 0, 1))
CAMERAS = ["--pitch-mm", 2, 2, "--focal-mm", 35, "--sensor-mm", 36]


def write_matlab_7_3(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """As MATLAB does: HDF5 behind a block of 512 bytes, arrays with their axes from the last to the first."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, array in arrays.items():
            file[name] = array.T
        file["#refs#/a"] = np.zeros((1, 2, 3))  # where cells are
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")


def write_hdf5(path: Path, arrays: dict[str, np.ndarray]) -> None:
    with h5py.File(path, "w") as file:
        for name, array in arrays.items():
            file[f"run/{name}"] = array


WRITERS: dict[str, Any] = {
    "a.npz": lambda path, arrays: np.savez(path, **arrays),
    "a.mat": savemat,
    "b.mat": write_matlab_7_3,
    "a.h5": write_hdf5,
}


@pytest.mark.parametrize("name", WRITERS)
def test_files_of_several_arrays(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    prefix = "run/" if name.endswith("h5") else ""
    WRITERS[name](path, {"LF": HWKL, "gain": np.ones((1, 2))})
    views = pcii.import_arrays(path, OPTICS, axes="HWKL")
    np.testing.assert_array_equal(views.radiance[..., 0], VIEWS_KLHW)
    counts = (HWKL * 9).astype(np.uint16)
    WRITERS[name](path, {"LF": HWKL, "photons": counts})
    found = pcii.import_counts(path, OPTICS, axes="HWKL", key=f"{prefix}photons")
    np.testing.assert_array_equal(found.dense, counts.transpose(2, 3, 0, 1))
    with pytest.raises(InputError, match=rf"holds {prefix}LF 20 x 24 x 3 x 3.*; say which with --key"):
        pcii.import_arrays(path, OPTICS, axes="HWKL")
    with pytest.raises(InputError, match="and no lf; correct --key"):
        pcii.import_arrays(path, OPTICS, axes="HWKL", key="lf")
    if name == "a.npz":
        WRITERS[name](path, {"LF": HWKL, "notes": np.array({"lens": "f/2"}, dtype=object)})
        np.testing.assert_array_equal(pcii.import_arrays(path, OPTICS, axes="HWKL").radiance, views.radiance)


def test_a_folder_of_an_array_for_each_view(tmp_path: Path) -> None:
    counts = (VIEWS_KLHW * 9).astype(np.uint8)
    for k, l in np.ndindex(3, 3):
        savemat(tmp_path / f"{k}_{l}.mat", {"frames": counts[k, l], "time": 1.0})
    found = pcii.import_counts(tmp_path, OPTICS, pattern="{row}_{col}.mat", key="frames")
    np.testing.assert_array_equal(found.dense, counts)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.npy", b"version https://git-lfs.github.com/spec/v1\noid", "is a pointer of Git LFS"),
        ("a.h5", b"\x89HDF\r\n\x1a\n" + bytes(99), "nor in a .npz, .mat or HDF5 file"),
        ("colmap/cameras.bin", b"", "is a model of COLMAP"),
    ],
)
def test_other_files_are_named(tmp_path: Path, capsys: Any, name: str, content: bytes, words: str) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content)
    source = path if path.parent == tmp_path else path.parent
    check_refused(source, tmp_path / "out", CAMERAS, words, capsys)


def write_depth(path: Path, z_mm: np.ndarray) -> None:
    """In mm, of a .exr file as renderers write them: in metres, as one channel of several.

    0 is unknown, which some write as the largest number or as NaN.
    """
    if path.suffix == ".png":
        Image.fromarray(np.where(z_mm == 0, 65535, z_mm).astype(np.uint16)).save(path)
    elif path.suffix == ".npy":
        np.save(path, np.where(z_mm == 0, np.nan, z_mm))
    else:
        layer = "ViewLayer.Depth.Z"
        channels = {layer: (z_mm / 1000).astype(np.float32), "ViewLayer.Combined.R": np.zeros_like(z_mm)}
        OpenEXR.File({}, channels).write(str(path))


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("z.png", []),
        ("z.exr", ["--depth-unit-mm", 1000]),
        ("ray.npy", ["--depth-along-ray"]),
        ("z.npz", ["--depth-key", "z"]),
    ],
)
def test_true_depth_beside_views(tmp_path: Path, capsys: Any, name: str, options: list[Any]) -> None:
    grid = OPTICS.grid(VIEWS_KLHW.shape)
    z_mm = np.full((20, 24), 90.0, np.float32)
    z_mm[5:9, 5:9], z_mm[0] = 45, 0  # a row of which nothing is known
    across, down = np.meshgrid(np.arange(24) - 11.5, np.arange(20) - 9.5)
    ray = np.sqrt(1 + (across**2 + down**2) * (grid.pixel_mm / grid.focal_mm) ** 2)
    write_depth(tmp_path / name, (z_mm * ray if name.startswith("ray") else z_mm).astype(np.float32))
    if name == "z.npz":
        np.savez(tmp_path / name, z=z_mm, other=z_mm[None])
    np.save(tmp_path / "views.npy", VIEWS_KLHW)
    arguments = [*CAMERAS, "--depth", tmp_path / name, *options]
    assert run("import", tmp_path / "views.npy", "-o", tmp_path / "out", *arguments) == 0
    printed = capsys.readouterr().out
    assert f"with the true depth of the virtual centre, 45 to 90 mm, from {name}" in printed
    assert "24 of 480 pixels have no known depth there, and count in no score" in printed
    dataset = pcii.open_dataset(tmp_path / "out")
    truth = dataset.truth
    assert truth is not None
    assert dataset.views is not None
    planes = pcii.FocalPlanes.at_depths(grid, [45, 90])
    masks = pcii.TrueFocus(planes, truth).by_pixel
    focus = pcii.Segmented(
        masks, "by hand", pcii.reconstruct(pcii.limit_photons(dataset.views, 100, seed=1), planes)
    )
    by_object, by_pixel = (
        [row["precision"] for row in pcii.score(focus, None, truth).planes if row["truth"] == kind]
        for kind in ("object", "pixel")
    )
    assert (by_object, by_pixel) == ([None, None], [1.0, 1.0])  # objects have no names
    assert truth.mask_kind == "pixel"  # what reports show
    np.testing.assert_allclose(truth.z_mm[1:], z_mm[1:], rtol=1e-6)
    answer = pcii.DepthMap(np.where(z_mm == 0, 20, z_mm), np.ones(z_mm.shape))
    errors = depth_errors(grid, answer, truth)
    assert (errors["within_1px"], errors["ece"]) == (1.0, 0.0)
    answer = pcii.DepthMap(np.full(z_mm.shape, 90.0), np.ones(z_mm.shape))
    assert depth_errors(grid, answer, truth)["within_1px"] == 1 - 16 / (19 * 24)


RGB = {name: np.full((20, 24), value, np.float32) for name, value in (("R", 1), ("G", 2), ("B", 3))}


@pytest.mark.parametrize(
    ("z", "options", "words"),
    [
        (np.ones((20, 23)), [], r"is float64 \(20, 23\); expected real numbers \(20, 24\)"),
        (np.zeros((20, 24)), [], "has no known depth"),
        (np.full((20, 24), 0.04), [], "has 0.04 mm, where depths are .* correct --depth-unit-mm"),
        (np.full((20, 24), 0.04), ["--depth-key", "z"], "--depth-key is for .npz"),
        (None, ["--depth-along-ray"], "are for a file of --depth"),
        (RGB, [], "has colours or several pages"),
        (np.full((20, 24), 0.6), [], None),
    ],
)
def test_depths_that_cannot_be_are_refused_and_those_in_metres_named(
    tmp_path: Path, capsys: Any, z: Any, options: list[str], words: str | None
) -> None:
    source, out = tmp_path / "views.npy", tmp_path / "out"
    np.save(source, VIEWS_KLHW)
    if z is RGB:
        OpenEXR.File({}, RGB).write(str(tmp_path / "z.exr"))
    elif z is not None:
        np.save(tmp_path / "z.npy", z)
    options = [*CAMERAS, *options, *(f"--depth={file}" for file in tmp_path.glob("z.*"))]
    if words:
        check_refused(source, out, options, words, capsys)
    else:
        assert run("import", source, "-o", out, *options) == 0
        assert "warning: z.npy has depths of 0.6 to 0.6 mm, nearer than the focal" in capsys.readouterr().out

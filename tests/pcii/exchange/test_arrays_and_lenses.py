"""Benchmark scenes, arrays, lens arrays, photon frames and maps of true depth: each by a few numbers."""

import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import OpenEXR
import pytest
import tifffile
from command_runs import run_pcii as run
from picture_folders import OPTICS, H, W, check_refused, numbers, write
from PIL import Image
from png_files import chunk, compressed, png_file
from rendered_cards import Card, render
from scipy.io import savemat

import pcii
from pcii import CameraGrid, InputError, LensArray, Optics, ViewOrder
from pcii.metrics import depth_errors
from pcii.types import disparity_px

PARAMETERS = """[intrinsics]
focal_length_mm = 100.0
image_resolution_x_px = {width}
image_resolution_y_px = {height}
sensor_size_mm = 35.0
[extrinsics]
num_cams_x = {cols}
num_cams_y = {rows}
baseline_mm = 25.0
focus_distance_m = 4.25
[meta]
disp_min = -1.6
disp_max = 1.5
"""


def pfm(path: Path, image: np.ndarray, scale: float = -1.0) -> None:
    head = f"Pf\n{image.shape[1]} {image.shape[0]}\n{scale:g}\n".encode()
    path.write_bytes(head + image[::-1].astype("<f4" if scale < 0 else ">f4").tobytes())


def hci_folder(root: Path, rows: int = 3, cols: int = 3) -> Path:
    root.mkdir()
    (root / "parameters.cfg").write_text(PARAMETERS.format(height=H, width=W, rows=rows, cols=cols))
    for number in range(rows * cols):
        write(root / f"input_Cam{number:03d}.png", numbers(*divmod(number, cols)))
    return root


@pytest.mark.parametrize("scale", [-1.0, 1.0])
@pytest.mark.parametrize("name", ["gt_depth_lowres.pfm", "gt_disp_lowres.pfm"])
def test_a_scene_of_the_hci_benchmark(tmp_path: Path, name: str, scale: float) -> None:
    root = hci_folder(tmp_path / "scene")
    depth_m = np.linspace(3, 6, H * W).reshape(H, W)
    # As the benchmark's toolkit has it: baseline in m, focus distance in m, sensor and focal length in mm.
    factor = 0.025 * 100.0 * W
    disparity = (factor * 4.25 / depth_m - factor) / 4.25 / 35.0
    pfm(root / name, depth_m if "depth" in name else disparity, scale)
    scene: Any = pcii.import_hci(root, note=[].append)
    grid = scene.views.grid
    assert (grid.rows, grid.cols, grid.pitch_mm) == (3, 3, (25.0, 25.0))
    np.testing.assert_allclose(scene.truth.z_mm, 1000 * depth_m, rtol=1e-5)
    across, down = disparity_px(grid, 1000 * depth_m)  # the cameras see the disparities of the benchmark
    np.testing.assert_allclose([across, down], [disparity, disparity], atol=1e-6)
    np.testing.assert_allclose(np.ravel(disparity_px(grid, 4250.0)), 0, atol=1e-12)
    assert scene.truth.names == {}


def test_the_depth_range_follows_from_the_disparities(tmp_path: Path) -> None:
    coarse = pcii.import_hci(hci_folder(tmp_path / "scene"))
    assert coarse.z_range_mm is None  # 8 px are so coarse that -1.6 px would be beyond infinity
    text = PARAMETERS.format(height=512, width=512, rows=1, cols=1)
    (tmp_path / "parameters.cfg").write_text(text)
    write(tmp_path / "input_Cam000.png", np.zeros((512, 512, 3), np.uint8))
    scene: Any = pcii.import_hci(tmp_path)
    near, far = (float(disparity_px(scene.views.grid, z)[0]) for z in scene.z_range_mm)
    assert (near, far) == (pytest.approx(1.5), pytest.approx(-1.6))


def test_the_map_of_an_even_grid_is_no_truth_of_the_virtual_centre(tmp_path: Path) -> None:
    root = hci_folder(tmp_path / "scene", rows=2, cols=3)
    pfm(root / "gt_depth_lowres.pfm", np.full((H, W), 4.0))
    notes: list[str] = []
    assert pcii.import_hci(root, note=notes.append).truth is None
    assert notes == ["not used: gt_depth_lowres.pfm, of a view beside the centre of an even grid, 2 x 3"]


def test_arrays_come_in(tmp_path: Path) -> None:
    light = np.random.default_rng(1).random((2, 3, H, W, 3))
    np.save(tmp_path / "a.npy", light)
    views = pcii.import_arrays(tmp_path / "a.npy", OPTICS)
    np.testing.assert_allclose(np.asarray(views.radiance), light, rtol=1e-6)
    counted = pcii.import_arrays(light.reshape(6, H, W, 3), OPTICS, grid=(2, 3))
    np.testing.assert_array_equal(np.asarray(counted.radiance), np.asarray(views.radiance))
    for array, grid in ((light, None), (light.reshape(6, H, W, 3), (3, 2))):
        swapped = pcii.import_arrays(array, OPTICS, grid=grid, order=ViewOrder(swap_axes=True))
        assert (swapped.grid.rows, swapped.grid.cols) == (3, 2)
        np.testing.assert_allclose(swapped.view(2, 1), light[1, 2], rtol=1e-6)


GRID = CameraGrid(rows=4, cols=5, pitch_mm=(1.5, 1.5), focal_mm=3.0, pixel_mm=0.025, height=60, width=60)
"""A lens array: 60 px are 1.5 mm. Disparity 180 px mm / z from lens to lens."""


def lens_picture(path: Path, views: np.ndarray, *, inverted: bool, margin: int = 0) -> Path:
    K, L, h, w, _ = views.shape
    tiles = views[:, :, ::-1, ::-1] if inverted else views
    whole = np.zeros((K * h + 2 * margin, L * w + 2 * margin, 3), np.float32)
    whole[margin : margin + K * h, margin : margin + L * w] = tiles.swapaxes(1, 2).reshape(K * h, L * w, 3)
    write(path, whole)
    return path


@pytest.mark.parametrize("inverted", [False, True])
def test_a_lens_array_is_cut_apart_and_an_inverted_one_recognised(tmp_path: Path, inverted: bool) -> None:
    views = render(GRID, [Card(60, seed=1), Card(25, (0.2, 0.8, 0.2, 0.6), 2)], cell=6)
    path = lens_picture(tmp_path / "lenses.exr", views, inverted=inverted, margin=3)
    optics = Optics(pitch_mm=(1.5, 1.5), focal_mm=3.0, pixel_mm=0.025)
    lenses = LensArray(rows=4, cols=5, pitch_px=(60, 60), offset_px=(3, 3), inverted=inverted)
    found = pcii.import_lens_array(path, lenses, optics, note=pytest.fail)
    assert found.grid == GRID
    np.testing.assert_allclose(np.asarray(found.radiance), views.astype(np.float32), atol=1e-6)
    assert pcii.check_grid(found, (15, 100)).order is None
    notes: list[str] = []
    pcii.import_lens_array(path, replace(lenses, rows=3, cols=3), optics, note=notes.append)
    assert notes == ["not used: room for 2 more columns and 1 more rows of lens images"]
    mistaken = LensArray(rows=4, cols=5, pitch_px=(60, 60), offset_px=(3, 3), inverted=not inverted)
    wrong = pcii.check_grid(pcii.import_lens_array(path, mistaken, optics), (15, 100))
    assert wrong.order == ViewOrder(flip_rows=True, flip_cols=True)


def test_lenses_between_pixels_keep_their_depth(tmp_path: Path) -> None:
    """Lenses every 20.3 px over a ramp of light: each image is the ramp from its own place on."""
    width = 5 * 21
    ramp = np.broadcast_to(np.arange(width, dtype=np.float32)[None, :, None], (25, width, 1))
    write(tmp_path / "ramp.exr", ramp)
    lenses = LensArray(rows=1, cols=5, pitch_px=(20.3, 20.0), offset_px=(1.5, 0))
    optics = Optics(pitch_mm=(1, 1), focal_mm=1, sensor_mm=105)
    views = pcii.import_lens_array(tmp_path / "ramp.exr", lenses, optics)
    assert views.radiance.shape == (1, 5, 20, 20, 1)
    assert views.grid.pixel_mm == 1.0
    for l in range(5):
        start = 1.5 + 20.3 * l + 0.15
        np.testing.assert_allclose(views.view(0, l)[0, :, 0], start + np.arange(20), rtol=1e-5)


def test_a_mosaic_that_cutting_would_break_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "few.png", numbers(0, 0, channels=1))
    even = LensArray(rows=1, cols=2, pitch_px=(4, 4))
    assert pcii.import_lens_array(tmp_path / "few.png", even, OPTICS, cfa="GRBG").cfa == "GRBG"
    for wrong in (replace(even, pitch_px=(3, 4)), replace(even, inverted=True)):
        with pytest.raises(InputError, match="is a mosaic"):
            pcii.import_lens_array(tmp_path / "few.png", wrong, OPTICS, cfa="GRBG")


GREY = np.random.default_rng(1).integers(0, 65536, (H, W)).astype(np.uint16)
BITS = np.random.default_rng(2).random((2, 2, 5, H, W)) < 0.3
COUNTS = np.random.default_rng(3).poisson(2.0, (2, 2, 5, H, W))


@pytest.mark.parametrize(("value", "unused"), [(0.45455, []), (1.0, ["not used: the gamma of 1 in 0_0.png"])])
def test_a_gamma_that_is_not_used_is_named(tmp_path: Path, value: float, unused: list[str]) -> None:
    pixels = compressed((GREY >> 8).astype(np.uint8))
    gamma = chunk(b"gAMA", struct.pack(">I", round(1e5 * value)))
    (tmp_path / "0_0.png").write_bytes(png_file(W, H, 8, 0, pixels, gamma))
    (tmp_path / "._0_0.png").write_bytes(b"\0\5\x16\7")  # what macOS leaves beside files
    notes: list[str] = []
    views = pcii.import_images(tmp_path, "*{row}_{col}.png", OPTICS, encoding="linear", note=notes.append)
    np.testing.assert_allclose(views.view(0, 0)[..., 0], (GREY >> 8) / 255, rtol=1e-6)
    assert notes == unused


def write_ome_set(folder: Path) -> None:
    """Files of which each holds the frames of one view, and names all the others as parts of one image."""
    names = {(k, l): f"{k}_{l}.tif" for k, l in np.ndindex(2, 2)}
    data = "".join(
        f'<TiffData FirstZ="{z}" FirstT="0" FirstC="0" IFD="0" PlaneCount="5"><UUID FileName="{name}">'
        f"urn:uuid:{z:032d}</UUID></TiffData>"
        for z, name in enumerate(names.values())
    )
    for z, (camera, name) in enumerate(names.items()):
        ome = (
            '<?xml version="1.0"?><OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06" '
            f'UUID="urn:uuid:{z:032d}"><Image ID="Image:0"><Pixels ID="Pixels:0" DimensionOrder="XYTZC" '
            f'Type="uint16" SizeX="{W}" SizeY="{H}" SizeT="5" SizeZ="4" SizeC="1">'
            f'<Channel ID="Channel:0:0" SamplesPerPixel="1"/>{data}</Pixels></Image></OME>'
        )
        tifffile.imwrite(folder / name, COUNTS[camera].astype(np.uint16), description=ome, metadata=None)


def write_counts(folder: Path, kind: str) -> str:
    """Files of the frames of each view; returns the pattern of their names."""
    if kind == "OME set":
        write_ome_set(folder)
        return "{row}_{col}.tif"
    # ImageJ and tifffile write one header for all frames of a large stack, or one for each of several parts.
    options: dict[str, dict[str, Any]] = {"ImageJ": {"imagej": True, "truncate": True}}
    options |= {"shaped": {"truncate": True}, "appended": {"append": True}, ">u2": {"byteorder": ">"}}
    for k, l in np.ndindex(2, 2):
        path, frames = folder / f"{k}_{l}.tif", COUNTS[k, l].astype("int16" if kind == "int16" else "uint16")
        for part in np.split(frames, 5) if kind == "appended" else [frames]:
            tifffile.imwrite(path, part, photometric="minisblack", **options.get(kind, {}))
    return "{row}_{col}.tif"


@pytest.mark.parametrize("kind", ["plain", "ImageJ", "shaped", "appended", ">u2", "int16", "OME set"])
def test_frames_of_tiff_files_are_added_up(tmp_path: Path, kind: str) -> None:
    counts = pcii.import_counts(tmp_path, OPTICS, pattern=write_counts(tmp_path, kind))
    np.testing.assert_array_equal(counts.dense, COUNTS.sum(axis=2))
    assert counts.readout.frames == 5


@pytest.mark.parametrize(
    "array", [COUNTS, COUNTS.astype(">f8"), np.asfortranarray(COUNTS), BITS], ids=range(4)
)
def test_frames_of_arrays_are_added_up(tmp_path: Path, array: np.ndarray) -> None:
    np.save(tmp_path / "all.npy", array)
    for source in (array, tmp_path / "all.npy"):
        counts = pcii.import_counts(source, OPTICS, cfa="GRBG")
        np.testing.assert_array_equal(counts.dense, array.sum(axis=2))
        assert (counts.cfa, counts.readout.frames) == ("GRBG", 5)
        assert (counts.frame is not None) == (array is BITS)  # of one bit the frame of each count is kept
    np.save(tmp_path / "0_0.npy", array[0, 0, 0])  # one frame without an axis of frames
    single = pcii.import_counts(tmp_path, OPTICS, pattern="{row}_{col}.npy", note=[].append)
    np.testing.assert_array_equal(single.view(0, 0), array[0, 0, 0])
    with pytest.raises(InputError, match="--counts for photons; got int64"):
        pcii.import_arrays(COUNTS, OPTICS)


@pytest.mark.parametrize(
    ("ending", "words"),
    [("jpg", "not a PNG, TIFF or EXR picture"), ("tif", r"a calibration of ImageJ \(c0, c1\)")],
)
def test_pictures_that_do_not_keep_counts_are_refused(tmp_path: Path, ending: str, words: str) -> None:
    Image.fromarray(numbers(0, 0)[..., 0]).save(tmp_path / "0_0.jpg")
    signed: dict[str, Any] = {"imagej": True, "metadata": {"c0": -32768.0, "c1": 1.0}}
    tifffile.imwrite(tmp_path / "0_0.tif", (COUNTS[0, 0] + 32768).astype(np.uint16), **signed)
    with pytest.raises(InputError, match=words):
        pcii.import_counts(tmp_path, OPTICS, pattern=f"{{row}}_{{col}}.{ending}", note=[].append)


def test_a_benchmark_folder_of_another_system(tmp_path: Path) -> None:
    """Ends of lines, remarks, names in capitals, an author in Latin-1, a map with a scale, another file."""
    root = hci_folder(tmp_path / "scene")
    text = (root / "parameters.cfg").read_text().replace("= 100.0", "= 100.0 ; mm") + "authors = Jürgen\n"
    (root / "parameters.cfg").write_bytes(text.replace("\n", "\r\n").encode("latin-1"))
    for path in root.glob("*.png"):
        path.rename(path.with_suffix(".PNG"))
    pfm(root / "gt_depth_lowres.pfm", np.full((H, W), 2.0), scale=-2.0)
    (root / "valid.png").write_bytes(b"")
    notes: list[str] = []
    scene: Any = pcii.import_hci(root, note=notes.append)
    assert scene.views.grid.focal_mm == 100
    assert notes[1:] == ["not used: valid.png", "not used of parameters.cfg: authors"]
    np.testing.assert_allclose(scene.truth.z_mm, 4000)


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


DEPTH_FILES = {"z.png": [], "z.exr": ["--depth-unit-mm", 1000], "ray.npy": ["--depth-along-ray"]}
DEPTH_FILES |= {"z.npz": ["--depth-key", "z"]}


@pytest.mark.parametrize(("name", "options"), DEPTH_FILES.items())
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
    dataset: Any = pcii.open_dataset(tmp_path / "out")
    truth, planes = dataset.truth, pcii.FocalPlanes.at_depths(grid, [45, 90])
    sections = pcii.reconstruct(pcii.limit_photons(dataset.views, 100, seed=1), planes)
    focus = pcii.Segmented(pcii.TrueFocus(planes, truth).by_pixel, "by hand", sections)
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

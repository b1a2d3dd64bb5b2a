"""`pcii import` as a new user types it, pictures of any format, and a dozen ways to give something wrong."""

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from command_runs import run_pcii as run
from picture_folders import OPTICS, H, W, check_refused, make_folder, numbers, write
from PIL import Image, ImageCms
from rendered_cards import Card, render
from test_arrays_and_lenses import hci_folder, pfm

from pcii import CameraGrid, InputError, import_arrays, import_images, open_dataset, sample
from pcii.base import linear_to_srgb, srgb_to_linear
from pcii.store import verify

CAMERAS = ["--pitch-mm", "2", "2", "--focal-mm", "35", "--sensor-mm", "36"]
NAMED = ["--pattern", "{col}_{row}.png", *CAMERAS]
GRID = CameraGrid(rows=3, cols=3, pitch_mm=(2, 2), focal_mm=35, pixel_mm=36 / 120, height=90, width=120)


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """3 x 3 sRGB pictures by column and row: a card at 60 mm before a wall at 150 mm."""
    folder = tmp_path_factory.mktemp("photos")
    views = render(GRID, [Card(150, seed=1), Card(60, (0.2, 0.8, 0.2, 0.7), 2)], cell=8)
    for k, l in np.ndindex(3, 3):
        picture = (255 * linear_to_srgb(views[k, l])).round().astype(np.uint8)
        Image.fromarray(picture).save(folder / f"{l}_{k}.png")
    return folder


def test_a_new_users_pictures(photos: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "mine"
    limits = ["--cfa", "GRBG", "--photons", "300", "--z-range-mm", "30", "200"]
    assert run("import", photos, "-o", out, *NAMED, *limits) == 0
    printed = capsys.readouterr().out
    assert "3 x 3 views of 90 x 120 px, GRBG" in printed
    assert "warning" not in printed
    dataset: Any = open_dataset(out)
    assert (dataset.grid, dataset.cfa) == (GRID, "GRBG")
    assert dataset.counts.total == pytest.approx(9 * 300, abs=4 * np.sqrt(2700))
    assert dataset.light.photons == 300
    assert dataset.views.cfa == "GRBG"
    disparities = [467 / z for z in dataset.analysis["z_mm"]]  # in px, from the first camera to the last
    assert disparities == pytest.approx([467 / 60, 467 / 150], abs=0.75)
    assert dataset.analysis["z_range_mm"] == [30, 200]
    assert "300 photons expected in each view, seed 1" in dataset.manifest["origin"]
    assert verify(out) > 10
    assert run("import", photos, "-o", out, *NAMED, *limits) == 2  # the folder is not empty


def test_surfaces_of_photon_counts_are_where_the_depth_map_has_them(tmp_path: Path, capsys) -> None:
    np.save(tmp_path / "counts.npy", sample().counts.dense)
    cameras = ["--pitch-mm", 13.5, 13.5, "--focal-mm", 50, "--pixel-mm", 0.1408]
    limits = ["--counts", "--cfa", "GRBG", "--z-range-mm", 450, 750]
    assert run("import", tmp_path / "counts.npy", "-o", tmp_path / "out", *cameras, *limits) == 0
    printed = capsys.readouterr().out
    words = r"the depth map has most surfaces at (.*) mm; \d+% of its depths are right to 1 px"
    (found,) = re.findall(words, printed)
    depths_mm = [float(z) for z in found.split(", ")]
    assert depths_mm == pytest.approx([539, 618], abs=8)  # medians of the ball and the bird; 15 mm are 1 px
    assert open_dataset(tmp_path / "out").analysis["z_mm"] == depths_mm
    assert "sharpest" not in printed


FIT = "warning: the views fit together far better "
NOT_MIRRORED = ["--swap-axes", "--flip-cols"]
OUTSIDE = "warning: sharpest at .* mm, all outside of --z-range-mm; correct the range, --pitch-mm"
WRONG_PITCH = ["--pitch-mm", 20, 20, *CAMERAS[3:], "--z-range-mm", 30, 200]


@pytest.mark.parametrize(
    ("pattern", "options", "words"),
    [
        ("{row}_{col}.png", CAMERAS, f"{FIT}with --swap-axes;"),
        ("{col}_{row}.png", [*CAMERAS, *NOT_MIRRORED], f"{FIT}without --swap-axes --flip-cols;"),
        ("{col}_{row}.png", WRONG_PITCH, OUTSIDE),
    ],
)
def test_the_option_that_mends_is_named(
    photos: Path, tmp_path: Path, capsys, pattern, options, words
) -> None:
    assert run("import", photos, "-o", tmp_path / "mine", "--pattern", pattern, *options) == 0
    assert re.search(words, capsys.readouterr().out)


def test_pages_of_a_tiff_file_are_views(photos: Path, tmp_path: Path, capsys) -> None:
    across, down = list(np.ndindex(3, 3)), [(k, l) for l in range(3) for k in range(3)]
    for name, places, options in (("across", across, []), ("down", down, ["--swap-axes", "--grid", 3, 3])):
        file = tmp_path / f"{name}.tif"
        stack = np.stack([np.asarray(Image.open(photos / f"{l}_{k}.png")) for k, l in places])
        tifffile.imwrite(file, stack, photometric="rgb")
        assert run("import", file, "-o", tmp_path / name, *CAMERAS, *options) == 0
        assert "warning" not in capsys.readouterr().out
        views: Any = open_dataset(tmp_path / name).views
        np.testing.assert_allclose(views.view(1, 2), srgb_to_linear(stack[places.index((1, 2))]), rtol=1e-6)


@pytest.mark.parametrize(
    ("shear", "words"), [(0, "--shear-px, such as (2.[5-9]|3) (2.[5-9]|3);"), (2.7, "sharpest at 6")]
)
def test_shifted_pictures_are_said_to_be_sheared(tmp_path: Path, capsys, shear: float, words: str) -> None:
    """A wall at 1.6 and a card at 3.9 px per camera, of which 2.7 px were taken out."""
    shifted = replace(GRID, shear_px=(2.7, 2.7))
    views = render(shifted, [Card(150, seed=1), Card(60, (0.2, 0.8, 0.2, 0.7), 2)], cell=8)
    np.save(tmp_path / "in.npy", views.astype(np.float32))
    options = ["--shear-px", shear, shear] if shear else []
    assert run("import", tmp_path / "in.npy", "-o", tmp_path / "out", *CAMERAS, *options) == 0
    printed = capsys.readouterr().out
    assert re.search(words, printed)
    assert ("warning: things are sharp at disparities below 0" in printed) == (shear == 0)


def test_other_sources(tmp_path: Path, capsys) -> None:
    root = hci_folder(tmp_path / "hci")
    pfm(root / "gt_depth_lowres.pfm", np.full((H, W), 4.0))
    assert run("import", root, "-o", tmp_path / "a", "--photons", 50) == 0
    dataset: Any = open_dataset(tmp_path / "a")
    np.testing.assert_allclose(dataset.truth.z_mm, 4000)
    assert dataset.grid.shear_px[0] > 0
    np.save(tmp_path / "frames.npy", np.ones((2, 3, 4, H, W), np.uint8))
    cameras = ["--pitch-mm", 5, 5, "--focal-mm", 50, "--pixel-mm", 0.05]
    assert run("import", tmp_path / "frames.npy", "-o", tmp_path / "b", "--counts", *cameras) == 0
    assert open_dataset(tmp_path / "b").counts.total == 4 * 6 * H * W
    write(tmp_path / "lenses.png", np.tile(numbers(0, 0)[:, :6], (3, 4, 1)))
    lens = ["--lens-array", 3, 4, "--lens-pitch-px", 6, 6, "--focal-mm", 3, "--pixel-mm", 0.01]
    assert run("import", tmp_path / "lenses.png", "-o", tmp_path / "c", *lens) == 0
    grid = open_dataset(tmp_path / "c").grid
    assert (grid.rows, grid.cols, grid.height, grid.pitch_mm) == (3, 4, 6, (0.06, 0.06))
    assert "too few views, pixels or photons to judge the cameras by" in capsys.readouterr().out


Make = Callable[[Path], Any]


def folder(change: Make | None = None, **kinds: Any) -> Make:
    def make(root: Path) -> Path:
        made = make_folder(root / "in", **kinds)
        if change is not None:
            change(made)
        return made

    return make


def without_a_view(root: Path) -> None:
    (root / "1_1.png").unlink()


def with_alpha(root: Path) -> None:
    Image.new("RGBA", (W, H)).save(root / "0_0.png")


def turned(root: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.new("RGB", (W, H)).save(root / "0_0.png", "JPEG", exif=exif)


def array(shape: tuple[int, ...], dtype: Any = float) -> Make:
    def make(root: Path) -> Path:
        np.save(root / "in.npy", np.ones(shape, dtype))
        return root / "in.npy"

    return make


def channels(root: Path) -> None:
    frames = np.zeros((4, 2, H, W), np.uint8)
    tifffile.imwrite(root / "0_0.tif", frames, imagej=True, metadata={"axes": "TCYX"})


BY_INDEX = ["--pattern", "{index}_0.png", *CAMERAS, "--grid"]
TIFF = ["--pattern", "{col}_{row}.tif", *CAMERAS]
OF_CUBES = ["--frames", 0, 1, "--width", 3]
WRONG: list[tuple[Make, list[Any], str]] = [
    (folder(), ["--pattern", "v{index}.png", *CAMERAS], r"no file fits .* named like 0_0\.png"),
    (folder(without_a_view, rows=5, cols=5), NAMED, "1 of 5 x 5 files missing, first row 1, col 1"),
    (folder(), [*BY_INDEX, 10**20, 10**20], "too far apart for a grid of at most 100000 views"),
    (folder(), [*BY_INDEX, -1, -3], "views are not -1 x -3"),
    (folder(), ["--lens-array", 2, 2, *CAMERAS], "--lens-array is for one picture"),
    (folder(with_alpha), NAMED, "0_0.png: has an alpha channel"),
    (folder(turned), NAMED, r"has to be turned \(EXIF orientation 6\)"),
    (array((9, H, W, 3)), CAMERAS, r"shape \(9, 6, 8, 3\); give --grid if it is \(N, H, W, C\)"),
    (folder(channels, ending="tif"), [*TIFF, "--counts"], "the axes TCYX, frames of several channels"),
    (array((2, 2, H, W), np.uint8), CAMERAS, "may be sRGB of pictures or linear"),
    (folder(channels=1), [*NAMED, "--counts", "--photons", 9], "--photons: is for pictures"),
    (folder(), [*NAMED, *OF_CUBES], "--width, --frames: not for .*, which is read as pictures"),
]


@pytest.mark.parametrize(("make", "options", "words"), WRONG)
def test_one_sentence_and_exit_code_2(tmp_path: Path, capsys, make: Make, options, words: str) -> None:
    check_refused(make(tmp_path), tmp_path / "out", options, words, capsys)


PATTERN = "{col}_{row}.%s"


def by_the_standard(share: float) -> float:
    """sRGB to linear as IEC 61966-2-1 has it, one number at a time."""
    return share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize(
    ("ending", "dtype"),
    [*product(("png", "tif"), ("uint8", "uint16")), ("tif", "float32"), ("exr", "float32")],
)
def test_all_bits_of_every_format_arrive_and_opaque_alpha_is_left_out(
    tmp_path: Path, ending, dtype, channels
) -> None:
    folder = make_folder(tmp_path / "a", ending=ending, dtype=dtype, channels=channels)
    views = import_images(folder, PATTERN % ending, OPTICS, encoding="linear")
    assert views.radiance.shape == (2, 3, H, W, channels)
    most = {"uint8": 255, "uint16": 65535}.get(dtype, 1)
    for k, l in np.ndindex(2, 3):
        expected = numbers(k, l, dtype, channels).astype(np.float64) / most
        np.testing.assert_allclose(views.view(k, l), expected, rtol=1e-6)
    opaque = np.full((H, W), most, dtype)
    write(folder / f"0_0.{ending}", np.dstack([numbers(0, 0, dtype, channels), opaque]))
    with_alpha = import_images(folder, PATTERN % ending, OPTICS, encoding="linear")
    np.testing.assert_array_equal(with_alpha.view(0, 0), views.view(0, 0))


@pytest.mark.parametrize("bits", [4, 10, 12, 14])
def test_tiff_of_fewer_bits_than_its_numbers_is_as_bright(tmp_path: Path, bits: int) -> None:
    share = np.linspace(0, 1, H * W).reshape(H, W)
    stored = np.rint(share * (2**bits - 1)).astype(np.uint8 if bits < 8 else np.uint16)
    tifffile.imwrite(tmp_path / "0_0.tif", stored, bitspersample=bits, photometric="minisblack")
    half_a_step = 0.5 / (2**bits - 1)
    linear = import_images(tmp_path, PATTERN % "tif", OPTICS, encoding="linear").view(0, 0)[..., 0]
    np.testing.assert_allclose(linear, share, atol=1.01 * half_a_step)
    decoded = import_images(tmp_path, PATTERN % "tif", OPTICS).view(0, 0)[..., 0]
    expected = [by_the_standard(number / (2**bits - 1)) for number in stored.ravel().tolist()]
    np.testing.assert_allclose(decoded.ravel(), expected, rtol=1e-6)


def test_whole_numbers_are_srgb_and_floats_linear_unless_said(tmp_path: Path) -> None:
    share = float(numbers(1, 2)[3, 4, 1]) / 255
    make_folder(tmp_path / "png")
    make_folder(tmp_path / "exr", ending="exr", dtype=np.float32)
    curves: list[tuple[str, Any, float]] = [("png", None, by_the_standard(share)), ("png", "linear", share)]
    curves += [("png", 2.2, share**2.2), ("exr", None, share), ("exr", "srgb", by_the_standard(share))]
    for ending, encoding, expected in curves:
        views = import_images(tmp_path / ending, PATTERN % ending, OPTICS, encoding=encoding)
        assert views.view(1, 2)[3, 4, 1] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    ("names", "pattern", "grid"),
    [
        (lambda k, l: f"{l}_{k}.png", "{col}_{row}.png", None),
        (lambda k, l: f"input_Cam{3 * k + l:03d}.png", "input_Cam{index:03d}.png", (2, 3)),
        (lambda k, l: f"{3 * k + l + 998}.png", "{index}.png", (2, 3)),
        (lambda k, l: f"row {k}/[{l}].png", "row {row}/[{col}].png", None),
        (lambda k, l: f"view_{k - 1}_{l - 1:+d}.png", "view_{row}_{col}.png", None),
        (lambda k, l: f"out_{k:02d}_{l:02d}_{7.5 * l}_-{k}.25_.png", "out_{row}_{col}_*.png", None),
        (lambda k, l: f"{l}_{k}.{'PNG' if l else 'png'}", "{col}_{row}.png", None),
    ],
)
def test_names_say_which_view_it_is(tmp_path: Path, names, pattern, grid) -> None:
    for k, l in np.ndindex(2, 3):
        path = tmp_path / names(k, l)
        path.parent.mkdir(exist_ok=True)
        write(path, numbers(k, l))
    views = import_images(tmp_path, pattern, OPTICS, grid=grid, encoding="linear")
    for k, l in np.ndindex(2, 3):
        np.testing.assert_array_equal(np.rint(255 * views.view(k, l)), numbers(k, l))
    assert views.grid.pixel_mm == 36.0 / W
    assert (views.grid.rows, views.grid.cols) == (2, 3)


def test_files_that_do_not_fit_are_named(tmp_path: Path) -> None:
    folder = make_folder(tmp_path / "a")
    for name in ("0-2.png", "notes.txt", ".hidden"):
        (folder / name).write_bytes((folder / "0_0.png").read_bytes())
    with pytest.warns(UserWarning, match=r"^not used: 0-2\.png, notes\.txt, since --pattern does not fit$"):
        assert import_images(folder, PATTERN % "png", OPTICS).grid.rows == 2


def test_channels_and_pictures_that_are_not_used_are_named(tmp_path: Path) -> None:
    import OpenEXR

    planes = {name: np.ones((H, W), np.float32) for name in "RGBZ"}
    wide = (0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329)  # Rec. 2020
    with OpenEXR.File({"type": OpenEXR.scanlineimage, "chromaticities": wide}, planes) as file:
        file.write(str(tmp_path / "0_0.exr"))
    with pytest.warns(UserWarning, match=r"not used: the channels Z and the chromaticities in 0_0\.exr"):
        import_images(tmp_path, PATTERN % "exr", OPTICS)
    (tmp_path / "0_0.exr").unlink()
    first, second = (Image.fromarray(numbers(0, l)) for l in range(2))
    first.save(tmp_path / "0_0.jpg", "MPO", save_all=True, append_images=[second])
    with pytest.warns(UserWarning, match=r"not used: 1 more pictures in 0_0\.jpg"):
        views = import_images(tmp_path, PATTERN % "jpg", OPTICS)
    np.testing.assert_allclose(views.view(0, 0), srgb_to_linear(numbers(0, 0)), atol=0.1)
    notes: list[str] = []
    spaces: list[tuple[Any, str, bytes]] = [("sRGB", "srgb", b""), ("LAB", "other", b"")]
    for name, profile, more in [*spaces, ("sRGB", "gimp", b"Linear sRGB")]:
        content = ImageCms.ImageCmsProfile(ImageCms.createProfile(name)).tobytes() + more
        first.save(tmp_path / f"0_0.{profile}.png", icc_profile=content)
        import_images(tmp_path, f"{{col}}_{{row}}.{profile}.png", OPTICS, note=notes.append)
    named = [f"not used: the colour profile in 0_0.{profile}.png" for profile in ("other", "gimp")]
    assert [one for one in notes if "profile" in one] == named
    raw = np.full((H, W), 500, np.uint16)
    tags = [(33422, "B", 4, b"\x02\x01\x01\x00", False), (50714, "H", 1, 256, False)]
    tifffile.imwrite(tmp_path / "0_0.tif", raw, extratags=tags)
    import_images(tmp_path, "{col}_{row}.tif", OPTICS, note=notes.append)
    assert notes[-1].startswith("not used: the Bayer pattern BGGR (--cfa BGGR) and the levels of black")
    np.save(tmp_path / "0_0.npy", np.full((1, 2, H, W), 255.0))
    with pytest.raises(InputError, match="holds numbers from 255 to 255; encoded light is from 0 to 1"):
        import_arrays(tmp_path / "0_0.npy", OPTICS, encoding="srgb")

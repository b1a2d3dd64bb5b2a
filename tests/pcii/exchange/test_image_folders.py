"""Pictures become radiance: formats and bits, curves, which file is which view."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from picture_folders import OPTICS, H, W, make_folder, numbers, write
from PIL import Image, ImageCms

from pcii import InputError, import_arrays, import_images
from pcii.base import srgb_to_linear

PATTERN = "{col}_{row}.%s"


def by_the_standard(share: float) -> float:
    """sRGB to linear as IEC 61966-2-1 has it, one number at a time."""
    return share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize(
    ("ending", "dtype"),
    [
        ("png", "uint8"),
        ("png", "uint16"),
        ("tif", "uint8"),
        ("tif", "uint16"),
        ("tif", "float32"),
        ("exr", "float32"),
    ],
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
    spaces: list[tuple[Any, str]] = [("sRGB", "srgb"), ("LAB", "other")]
    for name, profile in spaces:
        content = ImageCms.ImageCmsProfile(ImageCms.createProfile(name)).tobytes()
        first.save(tmp_path / f"0_0.{profile}.png", icc_profile=content)
    linear = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes() + b"Linear sRGB"
    first.save(tmp_path / "0_0.gimp.png", icc_profile=linear)
    told: list[str] = []
    for profile in ("srgb", "other", "gimp"):
        import_images(tmp_path, f"{{col}}_{{row}}.{profile}.png", OPTICS, note=told.append)
    named = [f"not used: the colour profile in 0_0.{profile}.png" for profile in ("other", "gimp")]
    assert [one for one in told if "profile" in one] == named
    raw = np.full((H, W), 500, np.uint16)
    tags = [(33422, "B", 4, b"\x02\x01\x01\x00", False), (50714, "H", 1, 256, False)]
    tifffile.imwrite(tmp_path / "0_0.tif", raw, extratags=tags)
    import_images(tmp_path, "{col}_{row}.tif", OPTICS, note=told.append)
    assert told[-1].startswith("not used: the Bayer pattern BGGR (--cfa BGGR) and the levels of black")
    np.save(tmp_path / "0_0.npy", np.full((1, 2, H, W), 255.0))
    with pytest.raises(InputError, match="holds numbers up to 255; encoded light is 1 at white"):
        import_arrays(tmp_path / "0_0.npy", OPTICS, encoding="srgb")

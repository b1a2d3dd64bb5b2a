"""Frames as sensors keep them: what they are is said or recognised, and what looks wrong is named."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from command_runs import run_pcii as run
from picture_folders import OPTICS, check_refused
from PIL import Image

import pcii
from pcii import FrameFormat, InputError, import_counts
from pcii.types import mosaic

CAMERAS = ["--pitch-mm", 2, 2, "--focal-mm", 35, "--pixel-mm", 0.45]
H, W, FRAMES = 12, 32, 20
RNG = np.random.default_rng(5)
BITS = RNG.random((2, 2, FRAMES, H, W)) < 0.3


def imported_with_notes(source: Any, **options: Any) -> tuple[pcii.PhotonCounts, list[str]]:
    notes: list[str] = []
    return import_counts(source, OPTICS, note=notes.append, **options), notes


def test_frames_of_0_and_1_are_frames_of_one_bit() -> None:
    of_bits, notes = imported_with_notes(BITS)
    assert notes == []
    counts, notes = imported_with_notes(BITS.astype(np.uint8))
    assert [sentence.split(":")[0] for sentence in notes] == ["array is taken for frames of one bit"]
    assert counts.readout == of_bits.readout == pcii.import_counts(BITS, OPTICS).readout
    np.testing.assert_array_equal(counts.frame, of_bits.frame)
    np.testing.assert_array_equal(pcii.reconstruct(counts, 90).counts, pcii.reconstruct(of_bits, 90).counts)
    counts, notes = imported_with_notes(BITS.astype(np.uint8), stored=FrameFormat(bits=8))
    assert (notes, counts.readout.bits) == ([], 8)
    dim = np.zeros(BITS.shape, np.uint8)
    dim[..., 0, :3] = 1  # of 240 in 30 720 numbers 0.94 would be above 1 by chance
    counts, notes = imported_with_notes(dim)
    assert (notes, counts.readout.bits) == ([], None)


def test_numbers_above_one_that_light_would_give() -> None:
    light = np.random.default_rng(1).poisson(0.1, (1, 1, 1, 1000, 1000))
    _, (sentence,) = imported_with_notes(light.clip(max=1))
    (expected,) = re.findall("where (.*) would by chance", sentence)
    assert float(expected) == pytest.approx((light > 1).sum(), rel=0.05)
    _, (sentence,) = imported_with_notes(np.ones((1, 1, 1, 5, 5), np.uint8))
    assert "where 25 would by chance" in sentence


@pytest.mark.parametrize("bits", [2, 4, 12])
def test_frames_of_a_few_bits_saturate(bits: int) -> None:
    most = 2**bits - 1
    stored = np.minimum(RNG.poisson(0.95 * most, (2, 2, FRAMES, H, W)), most).astype(np.uint16)
    counts, _ = imported_with_notes(stored, stored=FrameFormat(bits=bits))
    assert counts.readout == type(counts.readout)(FRAMES, bits)
    np.testing.assert_array_equal(counts.dense, stored.sum(axis=2))
    with pytest.raises(InputError, match=f"counts to {most}, and --bits {bits - 1} hold {most // 2}"):
        imported_with_notes(stored, stored=FrameFormat(bits=bits - 1))


def smooth_bits(seed: int) -> np.ndarray:
    """Frames of bits of light that changes slowly from pixel to pixel."""
    rng, x = np.random.default_rng(seed), np.arange(64) / 64
    light = sum(np.cos(6.28 * (f * x + p)) for f, p in zip(rng.uniform(1, 5, 8), rng.random(8), strict=True))
    return rng.random((2, 2, 60, 48, 64)) < 0.1 + 0.02 * light


@pytest.mark.parametrize("cfa", [None, "GRBG"])
@pytest.mark.parametrize("order", ["big", "little"])
def test_the_order_of_bits_is_an_option_and_the_wrong_one_is_named(order: Any, cfa: str | None) -> None:
    bits, other = smooth_bits(3), "little" if order == "big" else "big"
    packed = np.packbits(bits, axis=4, bitorder=order)
    counts, notes = imported_with_notes(packed, stored=FrameFormat(bitpack=True, bit_order=order), cfa=cfa)
    np.testing.assert_array_equal(counts.dense, bits.sum(axis=2))
    assert notes == []
    _, notes = imported_with_notes(packed, stored=FrameFormat(bitpack=True, bit_order=other), cfa=cfa)
    assert [sentence.split("--")[-1] for sentence in notes] == [f"bit-order {order}"]
    for seed in range(20):  # noise is in no order
        noise = np.random.default_rng(seed).random((2, 2, 20, 16, 64)) < 0.2
        packed = np.packbits(noise, axis=4, bitorder=order)
        assert imported_with_notes(packed, stored=FrameFormat(bitpack=True, bit_order=order))[1] == []


def test_wrong_numbers_are_named_before_cameras_are_blamed_and_hot_pixels_counted(
    tmp_path: Path, capsys: Any
) -> None:
    np.save(tmp_path / "in.npy", np.packbits(smooth_bits(3), axis=4, bitorder="little"))
    assert run("import", tmp_path / "in.npy", "-o", tmp_path / "out", "--bitpack", *CAMERAS) == 0
    printed = capsys.readouterr().out
    assert "--bit-order little" in printed
    assert "fit together" not in printed
    counts = np.random.default_rng(4).poisson(1.0, (3, 3, 32, 32))
    counts[..., 3, 4] = counts[..., 20, 9] = 40
    np.save(tmp_path / "hot.npy", counts.astype(np.uint16))
    assert run("import", tmp_path / "hot.npy", "-o", tmp_path / "other", "--counts", *CAMERAS) == 0
    assert "2 of 1024 pixels are far brighter than all around them in most views" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("stored", "number"),
    [
        (FrameFormat(bitpack=True, frame_size=(W - 3, H)), "u1"),
        (FrameFormat(frame_size=(W, H), skip_bytes=(16, 3)), "u1"),
        (FrameFormat(frame_size=(W, H), skip_bytes=(0, 2), bits=12), "<u2"),
    ],
)
def test_files_without_a_header(tmp_path: Path, stored: FrameFormat, number: str) -> None:
    (width, height), (before, after) = stored.frame_size or (0, 0), stored.skip_bytes or (0, 0)
    frames = RNG.poisson(0.9, (2, 2, FRAMES, height, width)).clip(max=1 if stored.bitpack else 4095)
    for k, l in np.ndindex(2, 2):
        parts = np.packbits(frames[k, l], axis=2) if stored.bitpack else frames[k, l].astype(number)
        content = b"".join(b"x" * before + part.tobytes() + b"y" * after for part in parts)
        (tmp_path / f"{k}_{l}.bin").write_bytes(content)
    counts, _ = imported_with_notes(tmp_path, pattern="{row}_{col}.bin", stored=stored)
    np.testing.assert_array_equal(counts.dense, frames.sum(axis=2))
    assert counts.readout.frames == FRAMES
    (tmp_path / "0_0.bin").write_bytes((tmp_path / "1_1.bin").read_bytes()[1:])
    with pytest.raises(InputError, match="bytes are no whole number of frames of"):
        imported_with_notes(tmp_path, pattern="{row}_{col}.bin", stored=stored)


LACKS_A_FRAME = f"1 of 2 x 2 x {FRAMES} files missing, first row 1, col 0, frame 7"


def test_a_folder_of_frames_for_each_view(tmp_path: Path, capsys: Any) -> None:
    for k, l, t in np.ndindex(2, 2, FRAMES):
        (tmp_path / "in" / f"{k}_{l}").mkdir(parents=True, exist_ok=True)
        Image.fromarray(BITS[k, l, t]).save(tmp_path / "in" / f"{k}_{l}" / f"{t:04d}.png")
    command = ["import", tmp_path / "in", "--pattern", "{row}_{col}/{frame}.png", *CAMERAS]
    assert run(*command, "--counts", "-o", tmp_path / "out") == 0
    counts = pcii.open_dataset(tmp_path / "out").counts
    assert (counts.readout.frames, counts.readout.bits) == (FRAMES, 1)
    np.testing.assert_array_equal(counts.dense, BITS.sum(axis=2))
    assert run(*command, "-o", tmp_path / "other") == 2
    assert "{frame} is for frames of photon counts; give --counts too" in capsys.readouterr().err
    (tmp_path / "in" / "1_0" / "0007.png").unlink()
    check_refused(tmp_path / "in", tmp_path / "x", [*command[2:], "--counts"], LACKS_A_FRAME, capsys)


def test_a_cube_in_three_channels_is_a_mosaic(tmp_path: Path, capsys: Any) -> None:
    """As visionsim and the Single Photon Challenge have them."""
    bits = np.random.default_rng(1).random((FRAMES, H, 16, 3)) < [0.02, 0.05, 0.1]
    np.save(tmp_path / "frames.npy", np.packbits(bits, axis=2))
    pose = {"transform_matrix": np.eye(4).tolist()}
    text = {"fl_x": 20, "fl_y": 20, "cx": 8, "cy": 6, "w": 16, "h": H, "c": 3, "bitpack": True}
    text |= {"file_path": "frames.npy", "frames": [pose] * FRAMES}
    (tmp_path / "transforms.json").write_text(json.dumps(text))
    assert run("import", tmp_path, "-o", tmp_path / "out", "--focal-mm", 50, "--cfa", "RGGB") == 0
    assert "not used" not in capsys.readouterr().out
    dataset = pcii.open_dataset(tmp_path / "out")
    np.testing.assert_array_equal(dataset.counts.view(0, 0), mosaic(bits.sum(axis=0), "RGGB"))
    words = "has 3 channels; photon counts have one, or three of which --cfa says"
    check_refused(tmp_path, tmp_path / "a", ["--focal-mm", 50], words, capsys)
    (tmp_path / "transforms.json").write_text(json.dumps(text | {"c": 1}))
    check_refused(tmp_path, tmp_path / "b", ["--focal-mm", 50], "c: is 1, and .* has 3 channels", capsys)


def test_offset_and_gain_of_a_camera(tmp_path: Path) -> None:
    photons = np.random.default_rng(9).poisson(0.05, (3, 3, 32, 32))
    stored = np.round(100 + RNG.normal(0, 2, photons.shape) + 12 * photons).astype(np.uint16)
    _, (sentence,) = imported_with_notes(stored)
    assert re.search("no number of array is below 9.*--offset", sentence)
    counts, notes = imported_with_notes(stored, stored=FrameFormat(offset=100, gain=12))
    assert (counts.dense != photons).mean() < 0.005  # noise of 3 of its standard deviations is half a photon
    assert notes == []


def test_marks_are_named_and_a_mask_leaves_them_out(tmp_path: Path) -> None:
    stored = np.random.default_rng(9).poisson(0.05, (3, 3, 32, 32)).astype(np.uint32)
    clean = stored.copy()
    stored[..., 5, 5] = stored[..., 20, :] = 2**32 - 1
    _, (sentence,) = imported_with_notes(stored)
    assert sentence == (
        "warning: 33 numbers of array are 4294967295: give --mask FILE if that marks dead pixels"
    )
    dead = np.zeros((32, 32), np.uint8)
    dead[5, 5] = dead[20] = 255
    np.save(tmp_path / "dead.npy", dead)
    tifffile.imwrite(tmp_path / "dead.tif", dead)
    for name in ("dead.npy", "dead.tif"):
        counts, notes = imported_with_notes(stored, stored=FrameFormat(mask=tmp_path / name))
        np.testing.assert_array_equal(counts.dense, np.where(dead, 0, clean))
        assert notes[-1] == "33 pixels of --mask count nothing"
    for marked in (np.where(dead, -1, clean.astype(np.int32)), np.where(dead, np.nan, clean)):
        counts, _ = imported_with_notes(marked, stored=FrameFormat(mask=tmp_path / "dead.npy"))
        np.testing.assert_array_equal(counts.dense, np.where(dead, 0, clean))
    with pytest.raises(InputError, match=r"--mask: .* is \(32, 32\), and views are \(12, 32\)"):
        imported_with_notes(BITS, stored=FrameFormat(mask=tmp_path / "dead.npy"))


def test_numbers_that_are_stored_otherwise_are_named() -> None:
    counts = np.random.default_rng(9).poisson(3.0, (2, 2, 3, 40, 50)).astype(np.uint16)
    swapped = "multiples of 256; .*; if the bytes of each number are in the other order, swap"
    for stored, bits, words in (
        (counts.byteswap(), 12, swapped),
        (counts.clip(max=15) << 4, 8, "multiples of 16; if that is one photon, give --gain 16$"),
        (counts.clip(max=1) * 255, None, "multiples of 255; if that is one photon, give --gain 255$"),
        (counts.clip(max=3), None, "of the numbers of array are 3 and none is above, .* give --bits 2$"),
    ):
        _, (sentence,) = imported_with_notes(stored, stored=FrameFormat(bits=bits))
        assert re.search(words, sentence), sentence
    assert imported_with_notes(counts.clip(max=3), stored=FrameFormat(bits=2))[1] == []


@pytest.mark.parametrize("mean", [0.01, 0.3, 3, 40, 1000])
def test_photon_counts_of_any_light_are_not_warned_of(mean: float) -> None:
    x = np.linspace(0, 6, 64)
    for texture in (np.ones(64), 1 + 0.9 * np.sin(x)):
        counts = np.random.default_rng(2).poisson(mean * texture, (2, 2, 3, 48, 64))
        assert imported_with_notes(counts.astype(np.uint16))[1] == []


REFUSED = [
    ({"width": 8}, "--width: is for packed frames; give --bitpack too"),
    ({"bit_order": "little"}, "--bit-order: is for packed frames"),
    ({"skip_bytes": (1, 0)}, "--skip-bytes: is for files without a header; give --frame-size too"),
    ({"bits": 17}, "--bits: expected 1 to 16, got 17"),
    ({"bits": 2, "bitpack": True}, "--bits: expected 1 of packed frames, got 2"),
    ({"gain": 0.0}, "--gain: expected a number above 0, got 0"),
    ({"gain": np.inf}, "--gain: expected a number above 0, got inf"),
    ({"offset": 3.0, "bitpack": True}, "--offset, --gain: are for numbers"),
    ({"frame_size": (0, 4)}, "--frame-size, --skip-bytes: expected at least one pixel"),
]


@pytest.mark.parametrize(("options", "words"), REFUSED)
def test_formats_that_cannot_be_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=f"^{words}"):
        import_counts(BITS, OPTICS, stored=FrameFormat(**options))


@pytest.mark.parametrize("axes", ["HWKL", "LKWH", "HWN", "NHW"])
def test_the_axes_of_an_array_are_named(tmp_path: Path, axes: str) -> None:
    counts = np.random.default_rng(3).poisson(2.0, (2, 3, H, W))
    named = {"K": 0, "L": 1, "H": 2, "W": 3}
    stored = counts.transpose([named[axis] for axis in axes]) if "N" not in axes else counts.reshape(6, H, W)
    stored = stored.transpose(1, 2, 0) if axes == "HWN" else stored
    grid = (2, 3) if "N" in axes else None
    np.save(tmp_path / "in.npy", stored)
    for source in (stored, tmp_path / "in.npy"):
        found = import_counts(source, OPTICS, grid=grid, axes=axes)
        np.testing.assert_array_equal(found.dense, counts)
    views = pcii.import_arrays(stored.astype(np.float32), OPTICS, grid=grid, axes=axes)
    np.testing.assert_array_equal(views.radiance[..., 0], counts)


def test_options_of_arrays_are_refused_where_there_is_none(tmp_path: Path) -> None:
    pages = np.ones((4, H, W), np.uint16)
    tifffile.imwrite(tmp_path / "0_0.tif", pages, photometric="minisblack")
    pictures = {"source": tmp_path, "pattern": "{row}_{col}.tif"}
    for options, words in (
        ({"source": tmp_path / "0_0.tif", "axes": "NHW"}, "has a page for each view"),
        ({"source": tmp_path / "0_0.tif", "key": "a"}, "has a page for each view"),
        (pictures | {"axes": "THW"}, "--axes: is for one array"),
        (pictures | {"key": "a"}, "0_0.tif: --key is for .npz, .mat and HDF5 files"),
    ):
        with pytest.raises(InputError, match=words):
            imported_with_notes(**options)
    with pytest.raises(InputError, match="of Path, got float64"):
        pcii.import_images(np.ones((2, 2, H, W)), None, OPTICS)


def test_a_picture_of_interlaced_views(tmp_path: Path, capsys: Any) -> None:
    views = np.random.default_rng(3).integers(0, 256, (2, 4, H, W, 3), np.uint8)
    picture = views.transpose(2, 0, 3, 1, 4).reshape(2 * H, 4 * W, 3)
    Image.fromarray(picture).save(tmp_path / "lenses.png")
    command = [tmp_path / "lenses.png", "--pitch-mm", 2, 2, "--focal-mm", 35, "--sensor-mm", 16]
    assert run("import", *command, "-o", tmp_path / "out", "--interlaced", 2, 4, "--linear") == 0
    dataset: Any = pcii.open_dataset(tmp_path / "out")
    assert dataset.grid.pixel_mm == pytest.approx(16 / W)
    np.testing.assert_allclose(np.asarray(dataset.views.radiance), views / 255, atol=1e-6)
    options = [*command[1:], "--interlaced", 5, 4]
    check_refused(command[0], tmp_path / "x", options, "24 x 128 px are no whole blocks", capsys)


def test_frames_and_colours_have_axes_of_their_own_and_all_must_fit() -> None:
    frames = np.random.default_rng(3).random((H, W, 3, 2, 2, FRAMES)) < 0.2
    counts = import_counts(frames, OPTICS, axes="HWCKLT", cfa="GRBG")
    expected = mosaic(frames.sum(axis=5).transpose(3, 4, 0, 1, 2), "GRBG")
    np.testing.assert_array_equal(counts.dense, expected)
    radiance = np.random.default_rng(3).random((3, H, W, 2, 2))
    views = pcii.import_arrays(radiance, OPTICS, axes="CHWKL")
    np.testing.assert_allclose(np.asarray(views.radiance), radiance.transpose(3, 4, 1, 2, 0), rtol=1e-6)
    for shape, wrong, words in (
        ((40, 48, 5, 5), None, "would be more views than each has numbers; name the order .* such as HWKL"),
        ((40, 48, 5, 3, 3), None, "would be more views than each has numbers"),
        ((), None, r"expected \(K, L, "),
        ((40, 48, 3, 3), "HWK", "--axes: expected each axis once, K and L"),
        ((40, 48, 3, 3), "HWKK", "--axes: expected each axis once"),
        ((40, 48, 3), "HWKL", r"has the shape \(40, 48, 3\), and --axes HWKL are 4 axes"),
    ):
        for read in (import_counts, pcii.import_arrays):
            with pytest.raises(InputError, match=words):
                read(np.ones(shape), OPTICS, axes=wrong)
    with pytest.raises(InputError, match="array: has 2 x 3 views, and --grid states 3 x 2"):
        import_counts(np.ones((H, W, 2, 3)), OPTICS, axes="HWKL", grid=(3, 2))

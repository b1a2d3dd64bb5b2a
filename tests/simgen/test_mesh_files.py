"""Sound files of strangers: the same mesh in every form, pictures at their full depth."""

import struct
from pathlib import Path

import numpy as np
import pytest
import tifffile
from hostile_files import ply, scene_toml
from PIL import Image, ImageOps
from png_files import png16

from pcii.base import srgb_to_linear
from simgen.assets import Triangles, ply_bytes, read_assets, read_mesh
from simgen.spec import load_scene

# A roof: a square and a triangle that share two corners.
POINTS = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [2, 2, 3]], np.float32)
NORMALS = np.array([[0, 0, -1], [0, 0, -1], [0, 1, 0], [0, 1, 0], [0.6, 0, 0.8]], np.float32)
TEXCOORDS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.25]], np.float32)
POLYGONS = ((0, 1, 2, 3), (2, 3, 4))
FACES = [[0, 1, 2], [0, 2, 3], [2, 3, 4]]


def ply_of(form: str, texcoords: tuple[str, str], list_type: str = "uchar", double: bool = False) -> bytes:
    """The roof in PLY, after an element that is nobody's business."""
    names = ("x", "y", "z", "nx", "ny", "nz", *texcoords)
    real = "double" if double else "float"
    header = f"ply\nformat {form} 1.0\ncomment a roof\nelement odd 2\nproperty list uchar short bits\n"
    header += "element vertex 5\n" + "".join(f"property {real} {name}\n" for name in names)
    header += (
        f"element face 2\nproperty uchar flags\nproperty list {list_type} uint vertex_index\nend_header\n"
    )
    rows = np.hstack([POINTS, NORMALS, TEXCOORDS])
    if form == "ascii":
        text = "1 7\n0\n" + "".join(" ".join(map(str, row)) + "\n" for row in rows.tolist())
        text += "".join(f"9 {len(face)} {' '.join(map(str, face))}\n" for face in POLYGONS)
        return (header + text).encode()
    order = "<" if "little" in form else ">"
    body = struct.pack(f"{order}BhB", 1, 7, 0) + rows.astype(f"{order}{'f8' if double else 'f4'}").tobytes()
    for face in POLYGONS:
        code = {"uchar": "B", "int": "i"}[list_type]
        body += struct.pack(f"{order}B{code}{len(face)}I", 9, len(face), *face)
    return header.encode() + body


def obj_of(*, from_the_end: bool = False) -> bytes:
    """The roof in OBJ, with materials that nobody looks for."""
    lines = ["mtllib /etc/passwd", "o roof", "usemtl ../../x", "s 1"]
    for word, rows in (("v", POINTS), ("vt", TEXCOORDS), ("vn", NORMALS)):
        lines += [f"{word} {' '.join(map(str, row))}" for row in rows.tolist()]
    for face in POLYGONS:
        numbers = [number - 5 if from_the_end else number + 1 for number in face]
        lines.append("f " + " ".join(f"{n}/{n}/{n}" for n in numbers))
    return "\r\n".join(lines).encode()


def read(folder: Path, name: str, content: bytes) -> Triangles:
    (folder / name).write_bytes(content)
    return read_mesh(folder / name)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.ply", ply_of("ascii", ("s", "t"))),
        ("a.ply", ply_of("binary_little_endian", ("s", "t"), "int")),
        ("a.ply", ply_of("binary_little_endian", ("texture_u", "texture_v"))),
        ("a.ply", ply_of("binary_big_endian", ("s", "t"), "int", double=True)),
        ("a.ply", ply_bytes(Triangles(POINTS, np.array(FACES, np.int32), NORMALS, TEXCOORDS))),
        ("a.obj", obj_of()),
        ("a.obj", obj_of(from_the_end=True)),
    ],
)
def test_every_form_gives_the_same_triangles(name: str, content: bytes, tmp_path: Path) -> None:
    mesh = read(tmp_path, name, content)
    np.testing.assert_array_equal(mesh.positions, POINTS)
    np.testing.assert_array_equal(mesh.faces, FACES)
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals, NORMALS, atol=1e-7)  # of length 1 once more
    np.testing.assert_array_equal(mesh.texcoords, TEXCOORDS)


def test_a_corner_of_an_obj_is_split_where_its_texture_is(tmp_path: Path) -> None:
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "vt 0 0", "vt 1 0", "vt 0 1", "f 1/1 2/2 3/3", "f 1/3 2/2 3/3"]
    mesh = read(tmp_path, "a.obj", "\n".join(lines).encode())
    assert len(mesh.positions) == 4
    assert mesh.texcoords is not None
    np.testing.assert_array_equal(mesh.positions[mesh.faces[0]], mesh.positions[mesh.faces[1]])
    np.testing.assert_array_equal(mesh.texcoords[mesh.faces[:, 0]], [[0, 0], [0, 1]])


@pytest.mark.parametrize("axis", range(3))
def test_polygons_that_are_not_convex_keep_their_area(axis: int, tmp_path: Path) -> None:
    turn = np.arange(14) * 2 * np.pi / 14
    star = np.stack([np.cos(turn), np.sin(turn)], axis=1) * np.where(np.arange(14) % 2, 1, 0.3)[:, None]
    ell = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]) + 5.0
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) - 5.0
    lines, first, area = list[str](), 1, 0.0
    for flat in (star, ell, square):
        x, y = flat.T
        area += abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
        lines += [f"v {' '.join(map(str, point))}" for point in np.insert(flat, axis, 1.0, axis=1)]
        lines.append("f " + " ".join(str(first + number) for number in range(len(flat))))
        first += len(flat)
    mesh = read(tmp_path, "a.obj", "\n".join(lines).encode())
    a, b, c = np.moveaxis(mesh.positions[mesh.faces].astype(np.float64), 1, 0)
    normals = np.cross(b - a, c - a)
    assert len(normals) == 12 + 4 + 2
    assert np.linalg.norm(normals, axis=1).sum() / 2 == pytest.approx(area, rel=1e-5)
    assert len(np.unique(np.sign(normals[:, axis]))) == 1  # all are seen from one side


def test_vertices_without_faces_do_not_count(tmp_path: Path) -> None:
    content = ply("0 0 0\n1 0 0\nnan nan nan\n0 1 0\n", "3 0 1 3\n", vertex_count=4)
    mesh = read(tmp_path, "a.ply", content)
    np.testing.assert_array_equal(mesh.positions, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2]])
    assert mesh.normals is None
    assert mesh.texcoords is None


def image_of(folder: Path, name: str) -> np.ndarray:
    """A file as the texture of a scene."""
    (folder / "scene.toml").write_text(scene_toml(material=f'texture = "{name}"'))
    return read_assets(load_scene(str(folder)), folder).image(name)


@pytest.mark.parametrize("channels", [1, 2, 3])
def test_16_bits_are_kept(channels: int, tmp_path: Path) -> None:
    pixels = np.random.default_rng(3).integers(0, 1 << 16, (5, 7, channels))
    colours = pixels
    if channels in (2, 4):
        pixels[..., -1], colours = 0xFFFF, pixels[..., :-1]
    (tmp_path / "deep.png").write_bytes(png16(pixels))
    expected = srgb_to_linear(np.broadcast_to(colours, (5, 7, 3)) / 65535)
    # float32; with 8 bits the differences would be 1e-3.
    np.testing.assert_allclose(image_of(tmp_path, "deep.png"), expected, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("mode", "name"), [("1", "a.png"), ("P", "a.png"), ("RGBA", "a.png"), ("L", "a.tif")]
)
def test_common_pictures_are_read(mode: str, name: str, tmp_path: Path) -> None:
    image = Image.new("RGB", (3, 2), "white")
    image.putpixel((2, 1), (0, 0, 0))
    image.convert(mode).save(tmp_path / name)
    pixels = image_of(tmp_path, name)
    assert pixels.dtype == np.float32
    np.testing.assert_array_equal(pixels[..., 1], [[1, 1, 1], [1, 1, 0]])


@pytest.mark.parametrize(("name", "orientation"), [("a.jpg", 2), ("a.jpg", 5), ("a.png", 6), ("a.tif", 8)])
def test_a_photograph_stands_as_its_camera_stood(name: str, orientation: int, tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = orientation
    pixels = np.random.default_rng(1).integers(0, 256, (4, 6, 3)).astype(np.uint8)
    Image.fromarray(pixels).save(tmp_path / name, exif=exif)
    with Image.open(tmp_path / name) as image:
        upright = np.asarray(ImageOps.exif_transpose(image))
    np.testing.assert_allclose(image_of(tmp_path, name), srgb_to_linear(upright), rtol=1e-6)


@pytest.mark.parametrize("bits", [4, 12])
def test_tiff_of_any_bits_is_as_bright(bits: int, tmp_path: Path) -> None:
    numbers = np.arange(6).reshape(2, 3) * ((1 << bits) - 1) // 5
    stored = numbers.astype({4: "uint8", 12: "uint16"}[bits])
    tifffile.imwrite(tmp_path / "a.tif", stored, photometric="minisblack", bitspersample=bits)
    expected = srgb_to_linear(numbers / ((1 << bits) - 1))
    half_a_step = 1e-5  # of 16 bits, where sRGB is steepest
    np.testing.assert_allclose(image_of(tmp_path, "a.tif")[..., 1], expected, rtol=1e-6, atol=half_a_step)

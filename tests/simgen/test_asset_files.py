"""Files of strangers: the same mesh in every form, pictures at full depth, one sentence for what is wrong."""

import io
import os
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from command_runs import run_simgen
from PIL import Image, ImageOps
from plyfile import PlyData
from png_files import png16, png_file

from pcii.base import InputError, srgb_to_linear
from pcii.store import write_exr_safely
from simgen.assets import Assets, Triangles, ply_bytes, read_assets, read_mesh
from simgen.spec import load_scene

# A roof: a square and a triangle that share two corners.
POINTS = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [2, 2, 3]], np.float32)
NORMALS = np.array([[0, 0, -1], [0, 0, -1], [0, 1, 0], [0, 1, 0], [0.6, 0, 0.8]], np.float32)
TEXCOORDS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.25]], np.float32)
POLYGONS = ((0, 1, 2, 3), (2, 3, 4))
FACES = [[0, 1, 2], [0, 2, 3], [2, 3, 4]]


def ply_of(texcoords: str, list_type: str = "uchar", real: str = "float", order: str = "=") -> bytes:
    """The roof in PLY, after an element that nobody needs: as text, or binary in an order of bytes."""
    header = "ply\nformat ascii 1.0\ncomment a roof\nelement odd 2\nproperty list uchar short bits\n"
    header += "element vertex 5\n"
    header += "".join(f"property {real} {name}\n" for name in ("x y z nx ny nz " + texcoords).split())
    header += f"element face 2\nproperty uchar flags\nproperty list {list_type} uint vertex_index\n"
    rows = np.hstack([POINTS, NORMALS, TEXCOORDS]).tolist()
    text = "end_header\n1 7\n0\n" + "".join(" ".join(map(str, row)) + "\n" for row in rows)
    text += "".join(f"9 {len(face)} {' '.join(map(str, face))}\n" for face in POLYGONS)
    file, roof = io.BytesIO(), PlyData.read(io.BytesIO((header + text).encode()))
    roof.text, roof.byte_order = order == "=", order
    roof.write(file)
    return file.getvalue()


def triangle_ply(vertices: str = "0 0 0\n10 0 0\n0 10 0\n", faces: str = "3 0 1 2\n") -> bytes:
    """A triangle as text, or what else these lines are."""
    names = "".join(f"property float {name}\n" for name in "xyz")
    header = f"ply\nformat ascii 1.0\nelement vertex {vertices.count(chr(10))}\n{names}"
    header += f"element face {faces.count(chr(10))}\nproperty list uchar int vertex_indices\nend_header\n"
    return (header + vertices + faces).encode()


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
        ("a.ply", ply_of("s t")),
        ("a.ply", ply_of("texture_u texture_v", order="<")),
        ("a.ply", ply_of("s t", "int", "double", order=">")),
        ("a.ply", ply_bytes(Triangles(POINTS, np.array(FACES, np.int32), NORMALS, TEXCOORDS))),
        ("a.obj", obj_of()),
        ("a.obj", obj_of(from_the_end=True)),
    ],
)
def test_every_form_gives_the_same_triangles(name: str, content: bytes, tmp_path: Path) -> None:
    mesh: Any = read(tmp_path, name, content)
    np.testing.assert_array_equal(mesh.positions, POINTS)
    np.testing.assert_array_equal(mesh.faces, FACES)
    np.testing.assert_allclose(mesh.normals, NORMALS, atol=1e-7)  # of length 1 once more
    np.testing.assert_array_equal(mesh.texcoords, TEXCOORDS)


def test_a_corner_of_an_obj_is_split_where_its_texture_is(tmp_path: Path) -> None:
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "vt 0 0", "vt 1 0", "vt 0 1", "f 1/1 2/2 3/3", "f 1/3 2/2 3/3"]
    mesh: Any = read(tmp_path, "a.obj", "\n".join(lines).encode())
    assert len(mesh.positions) == 4
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
    mesh = read(tmp_path, "a.ply", triangle_ply("0 0 0\n1 0 0\nnan nan nan\n0 1 0\n", "3 0 1 3\n"))
    np.testing.assert_array_equal(mesh.positions, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2]])
    assert mesh.normals is None
    assert mesh.texcoords is None


def assets_with(folder: Path, name: str) -> Assets:
    """What a scene reads whose object is, or wears, or whose light comes from, the file of this name."""
    shape, material, light = 'type = "sphere", radius_mm = 5.0', "reflectance = [1, 1, 1]", 'type = "uniform"'
    match name.rpartition(".")[2]:
        case "ply" | "obj" | "xml":
            shape = f'type = "mesh", file = "{name}"'
        case "exr" | "hdr":
            light = f'type = "environment", file = "{name}"'
        case _:
            material = f'texture = "{name}"'
    (folder / "scene.toml").write_text(
        f'title = "t"\nlights = [{{ {light}, luminance_cd_m2 = 1.0 }}]\n[[objects]]\nname = "a"\n'
        f"position_mm = [0, 0, 500]\nshape = {{ {shape} }}\nmaterial = {{ {material} }}\n"
    )
    return read_assets(load_scene(str(folder)), folder)


def image_of(folder: Path, name: str) -> np.ndarray:
    return assets_with(folder, name).image(name)


@pytest.mark.parametrize("channels", [1, 2, 3])
def test_16_bits_are_kept(channels: int, tmp_path: Path) -> None:
    pixels = np.random.default_rng(3).integers(0, 1 << 16, (5, 7, channels))
    colours = pixels
    if channels == 2:
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


def png(side: int = 4, data: bytes = b"") -> bytes:
    """A square PNG file with this header, whatever its pixels are."""
    return png_file(side, side, 8, 2, data or zlib.compress(bytes(side * (1 + side * 3))))


def picture(mode: str, form: str, pages: int = 1) -> bytes:
    file, pictures = io.BytesIO(), [Image.new(mode, (4, 4), colour) for colour in range(pages)]
    more = {"save_all": True, "append_images": pictures[1:]} if pages > 1 else {}
    pictures[0].save(file, form, **more)
    return file.getvalue()


ONES = np.ones((4, 8, 3))
REFUSED: list[tuple[str, bytes | np.ndarray | None, str]] = [
    ("a.ply", triangle_ply(faces="3 0 1 2000000000\n"), "vertex 2000000000, but only vertices 0 to 2"),
    ("a.ply", triangle_ply(faces="3 0 1 -1\n"), "vertex -1"),
    ("a.ply", triangle_ply("0 0 0\n10 nan 0\n0 10 0\n"), "a position of nan"),
    ("a.ply", triangle_ply(faces=""), "has no faces"),
    ("a.ply", ply_of("s t", order="<")[:-5], "cannot be read: element 'face'"),
    ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4 that cannot be used: 'f 1 2 4'"),
    ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\ng a\nf\n", "line 6 that cannot be used: 'f'"),
    ("a.obj", b"", "has no faces"),
    ("a.xml", b"<scene version='3.0.0'/>", "not named .ply or .obj"),
    ("a.png", png(60_000, zlib.compress(bytes(1 << 20))), "exceeds limit"),
    ("a.png", png()[:-30], "damaged or cut off"),
    ("a.png", picture("L", "PNG", pages=2), "holds 2 pictures"),
    ("a.png", picture("RGBA", "PNG"), "not opaque everywhere"),
    ("a.jpg", picture("CMYK", "JPEG"), "of the kind CMYK; save it as RGB"),
    ("a.png", b"", "not a PNG, JPEG or TIFF"),
    ("a.exr", np.nan * ONES, "not finite"),
    ("a.exr", -ONES, "negative"),
    ("a.exr", ONES[:, :4], "4 x 4 px, 3 channels"),
    ("a.hdr", b"#?RADIANCE\n", "not an EXR picture"),
    ("absent.png", None, "there is no file"),
    ("../secret.png", None, "lies outside"),
    ("link.png", None, "lies outside"),
    ("large.png", None, "larger than the 268435456 bytes"),
]


@pytest.mark.parametrize(("name", "content", "message"), REFUSED)
def test_a_file_that_cannot_be_used_is_refused_in_one_sentence(
    name: str, content: bytes | np.ndarray | None, message: str, tmp_path: Path
) -> None:
    """Before the renderer sees anything: `build` begins with `read_assets`."""
    folder = tmp_path / "mine"
    folder.mkdir()
    (tmp_path / "secret.png").write_bytes(png())
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    (folder / "large.png").write_bytes(png())
    os.truncate(folder / "large.png", 1 << 30)
    if isinstance(content, bytes):
        (folder / name).write_bytes(content)
    elif content is not None:
        write_exr_safely(folder / name, content.astype(np.float32))
    with pytest.raises(InputError) as caught:
        assets_with(folder, name)
    sentence = str(caught.value)
    assert name in sentence
    assert message in sentence
    assert sentence.isprintable()
    assert len(sentence) < 800


def test_the_command_leaves_with_2_and_one_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Of libraries nothing is printed either."""
    (tmp_path / "thing.ply").write_bytes(b"nonsense")
    with pytest.raises(InputError):
        assets_with(tmp_path, "thing.ply")
    assert run_simgen("preview", tmp_path, "-o", tmp_path / "x.png") == 2
    assert re.fullmatch("error: .*thing.ply.*\n", capfd.readouterr().err)
    assert not (tmp_path / "x.png").exists()

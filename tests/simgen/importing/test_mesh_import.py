"""Meshes alone become scenes: an object for each group or solid, upright, of the size that is stated."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pcii.base import InputError
from simgen import Mesh, Scene, import_scene, load_scene
from simgen.assets import Triangles, ply_bytes, read_mesh

CORNERS = [(x, y, z) for x in (-1, 1) for y in (-2, 2) for z in (-3, 3)]
"""Of a box 2 wide, 4 along Y, 6 along Z."""
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
FACETS = np.array([[CORNERS[i] for i in (q[0], q[a], q[a + 1])] for q in QUADS for a in (1, 2)], np.float32)
AT_600: dict[str, Any] = {"place_at_mm": (0, 0, 600)}


def write_obj(path: Path) -> None:
    """Two boxes side by side: the second counts its corners from the end, and has two materials.

    What a scene does not have are colours of vertices, and of materials a picture, glow and gloss.
    """

    def corners(shift: float) -> str:
        return "".join(f"v {x + shift} {y} {z} 1 0 0\n" for x, y, z in CORNERS)

    def faces(quads: list[tuple[int, ...]], shift: int) -> str:
        return "".join("f " + " ".join(str(i + shift) for i in quad) + "\n" for quad in quads)

    text = f"mtllib some.mtl\no left\nusemtl red\n{corners(-2)}{faces(QUADS, 1)}"
    text += f"o right\n{corners(2)}{faces(QUADS[:3], -8)}usemtl shiny blue\n{faces(QUADS[3:], -8)}"
    path.write_text(text)
    path.with_name("some.mtl").write_text(
        "newmtl red\nKd 0.8 0.1 0.1\nKs 0 0 0\nmap_Kd wood.png\nKe 0 0.5 0\n"
        "newmtl shiny blue\nKd 0 0 1.2\nKs 0.5 0.5 0.5\nd 1.0\n"
    )


def write_stl(path: Path, facets: np.ndarray = FACETS) -> None:
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *facet.ravel(), 0) for facet in facets)
    path.write_bytes(b"solid a binary file may begin so".ljust(80) + struct.pack("<I", len(facets)) + body)


def write_ascii_stl(path: Path) -> None:
    def solid(name: str, shift: float) -> str:
        loops = "".join(
            "facet normal 0 0 0\n outer loop\n"
            + "".join(f"  vertex {x + shift} {y} {z}\n" for x, y, z in facet)
            + " endloop\nendfacet\n"
            for facet in FACETS.tolist()
        )
        return f"solid {name}\n{loops}endsolid {name}\n"

    path.write_text(solid("one", -2) + solid("two", 2) + solid("two", 6))


def boxes_mm(scene: Scene, folder: Path) -> dict[str, list[float]]:
    """Left, upper and near end, then right, lower and far end of each object."""
    found = {}
    for thing in scene.objects:
        assert isinstance(thing.shape, Mesh)
        mesh = read_mesh(folder / thing.shape.file)
        turn = Rotation.from_euler("xyz", thing.rotation_deg, degrees=True)
        points = turn.apply(mesh.positions * thing.shape.scale) + thing.position_mm
        found[thing.name] = np.round([*points.min(axis=0), *points.max(axis=0)], 3).tolist()
    return found


def test_groups_of_an_obj_file_are_objects(tmp_path: Path) -> None:
    write_obj(tmp_path / "two.obj")
    imported = import_scene(tmp_path / "two.obj", tmp_path / "out", unit="cm", **AT_600)
    scene: Any = load_scene(str(tmp_path / "out"))
    assert boxes_mm(scene, tmp_path / "out") == {
        "left": [-30, -20, 570, -10, 20, 630],
        "right-red": [10, -20, 570, 30, 20, 630],
        "right-shiny-blue": [10, -20, 570, 30, 20, 630],
    }
    colours = [thing.material.reflectance for thing in scene.objects]
    assert colours == [(0.8, 0.1, 0.1), (0.8, 0.1, 0.1), (0, 0, 1)]
    assert set(imported.left_out) == {
        "colours of vertices",
        "pictures of materials (map_Kd)",
        "Ke of materials",
        "gloss of materials (Ks, Ns, Pr, Pm): all are matt",
        "the file has no light: the scene is lit evenly from all around",
    }
    assert not scene.light_around.visible
    assert imported.size_mm == pytest.approx((60, 40, 60))


def test_colours_of_vertices_of_a_ply_file_are_named(tmp_path: Path) -> None:
    triangle = Triangles(np.eye(3), np.array([[0, 1, 2]]), None, np.eye(3, 2))
    file = ply_bytes(triangle)
    (tmp_path / "a.ply").write_bytes(file.replace(b" s\n", b" red\n").replace(b" t\n", b" green\n"))
    imported = import_scene(tmp_path / "a.ply", tmp_path / "out", unit="cm", **AT_600)
    assert imported.left_out[0] == "colours of vertices"


@pytest.mark.parametrize("up", ["y", "z"])
def test_the_axis_that_is_up(tmp_path: Path, up: Any) -> None:
    # A triangle each at the right, top and far end of a cube, by the axes of the file.
    ends = {"right": (10, 0, 0), "top": (0, 10, 0) if up == "y" else (0, 0, 10)}
    ends["far"] = (0, 0, -10) if up == "y" else (0, 10, 0)
    ends |= {f"not {name}": tuple(-value for value in end) for name, end in ends.items()}
    text = ""
    for name, end in ends.items():
        lines = (f"v {' '.join(map(str, np.add(end, step)))}\n" for step in np.eye(3))
        text += f"o {name}\n{''.join(lines)}f -3 -2 -1\n"
    (tmp_path / "ends.obj").write_text(text)
    imported = import_scene(tmp_path / "ends.obj", tmp_path / "out", unit="mm", up=up, **AT_600)
    assert imported.size_mm == pytest.approx((21, 21, 21))
    boxes = boxes_mm(load_scene(str(tmp_path / "out")), tmp_path / "out")
    middles = {name: (np.add(box[:3], box[3:]) / 2).tolist() for name, box in boxes.items()}
    assert middles["right"][0] > 9
    assert middles["top"][1] < -9
    assert middles["far"][2] > 609


def test_solids_of_stl_files(tmp_path: Path) -> None:
    write_stl(tmp_path / "box.stl")
    imported = import_scene(tmp_path / "box.stl", tmp_path / "box", fit_mm=60, **AT_600)
    assert (imported.objects, imported.triangles) == (1, 12)
    assert imported.size_mm == pytest.approx((20, 40, 60))
    assert len(read_mesh(tmp_path / "box" / "box.ply").positions) == 8
    write_ascii_stl(tmp_path / "two.stl")
    import_scene(tmp_path / "two.stl", tmp_path / "two", unit="m", **AT_600)
    assert [thing.name for thing in load_scene(str(tmp_path / "two")).objects] == ["one", "two", "two-2"]


def test_meshes_that_cannot_be_imported(tmp_path: Path) -> None:
    write_stl(tmp_path / "a.stl")
    whole = (tmp_path / "a.stl").read_bytes()
    (tmp_path / "cut.stl").write_bytes(whole[:-30])
    (tmp_path / "empty.obj").write_text("v 0 0 0\n")
    nowhere = {"unit": "mm", "place_at_mm": None}
    cases = [
        ("a.stl", {}, "--unit: .* has no unit of length"),
        ("a.stl", nowhere, "has no camera; say where the middle of its 2 x 4 x 6 mm"),
        ("cut.stl", {"unit": "mm"}, "has no faces|cut off"),
        ("empty.obj", {"unit": "mm"}, "has no faces"),
        ("none.ply", {"unit": "mm"}, "cannot be read"),
    ]
    for name, options, words in cases:
        with pytest.raises(InputError, match=words):
            import_scene(tmp_path / name, tmp_path / "out", **(AT_600 | options))
    assert not (tmp_path / "out").exists()

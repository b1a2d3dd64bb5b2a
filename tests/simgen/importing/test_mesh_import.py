"""Meshes alone become scenes, upright and of the stated size; files with faults are one sentence each."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_draft import QUAD_UV, GltfDraft, glb
from scipy.spatial.transform import Rotation

from pcii.base import InputError
from simgen import Mesh, Scene, import_scene, load_scene
from simgen.assets import Triangles, ply_bytes, read_mesh

CORNERS = [(x, y, z) for x in (-1, 1) for y in (-2, 2) for z in (-3, 3)]
"""Of a box 2 wide, 4 along Y, 6 along Z."""
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
FACETS = np.array([[CORNERS[i] for i in (q[0], q[a], q[a + 1])] for q in QUADS for a in (1, 2)], np.float32)
AT_600: dict[str, Any] = {"place_at_mm": (0, 0, 600)}
MM: dict[str, Any] = {"unit": "mm"}
NOWHERE: dict[str, Any] = {"unit": "mm", "place_at_mm": None}


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


def plate(**mesh: Any) -> GltfDraft:
    draft = GltfDraft()
    draft.node(mesh=draft.mesh(uv=QUAD_UV, **mesh), name="plate")
    return draft


def changed(path: str, value: Any) -> bytes:
    """A sound binary file with another value at a dotted path of its JSON."""
    draft = plate()
    document = json.loads(json.dumps(draft.document()))
    *steps, last = [int(step) if step.isdigit() else step for step in path.split(".")]
    target: Any = document
    for step in steps:
        target = target[step]
    target[last] = value
    return glb(json.dumps(document).encode(), draft.bytes)


def with_uri(uri: str) -> bytes:
    return changed("buffers", [{"uri": uri, "byteLength": 4}])


NAN = np.array([(0, 0, 0), (1, 0, 0), (0, np.nan, 0), (0, 1, 0)], "<f4")
DRACO, ZEROS = "KHR_draco_mesh_compression", {"componentType": 5126, "count": 10**8, "type": "VEC3"}
FILES: list[tuple[bytes, str]] = [
    (b"\x00\x01\x02 this is no scene", "not a glTF file"),
    (b'{"asset": {"version": "1.0"}}', r"'asset.version'.* got '1.0'"),
    (plate().glb()[:300], "cut off"),
    (with_uri("http://example.org/a.bin"), "there is no file"),
    (with_uri("%2e%2e/%2e%2e/etc/passwd"), "lies outside"),
    (with_uri("data:;base64,AAAA"), r"accessors\[0\]: its 4 elements do not fit"),
    (changed("accessors.0", ZEROS), "at most 4194304 elements of VEC3 .* got 100000000"),
    (changed("meshes.0.primitives.0.indices", 99), r"no accessors\[99\]"),
    (changed("accessors.0.count", 3), "vertex 3, but only"),
    (plate(positions=NAN).glb(), r"accessors\[0\]: has numbers that are nan"),
    (changed("nodes.0.children", [0]), "stands in a circle"),
    (changed("extensionsRequired", [DRACO]), f"{DRACO}; export it without compression"),
    (b'{"asset": {"version": "2.0"}}', "no surface"),
]


@pytest.mark.parametrize(("content", "sentence"), FILES, ids=[sentence for _, sentence in FILES])
def test_one_sentence_says_what_is_wrong(content: bytes, sentence: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.glb"
    path.write_bytes(content)
    with pytest.raises(InputError, match=sentence) as refused:
        import_scene(path, tmp_path / "out", **AT_600)
    text = str(refused.value)
    assert text.startswith(str(path))
    assert "\n" not in text
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("name", "out", "options", "sentence"),
    [
        ("a.glb", "out", {"unit": "mile"}, "unit: expected one of mm, cm, m, in, ft, got 'mile'"),
        ("a.glb", "out", {"emission_unit": "lumen"}, "expected nit, or watt for a glTF file, got 'lumen'"),
        ("a.glb", "out", {"camera": "left"}, "give camera or place_at_mm, not both"),
        ("a.glb", "mine", {}, "mine: is there already"),
        ("a.fbx", "out", {}, r"expected a glTF file \(.glb or .gltf\)"),
        ("b.glb", "out", {}, "there is no such file"),
        ("a.stl", "out", {}, "--unit: .* has no unit of length"),
        ("a.stl", "out", NOWHERE, "has no camera; say where the middle of its 2 x 4 x 6 mm"),
        ("cut.stl", "out", MM, "has no faces|cut off"),
        ("empty.obj", "out", MM, "has no faces"),
        ("none.ply", "out", MM, "cannot be read"),
    ],
)
def test_wrong_files_names_and_options_are_refused(
    tmp_path: Path, name: str, out: str, options: dict[str, Any], sentence: str
) -> None:
    (tmp_path / "a.glb").write_bytes(plate().glb())
    write_stl(tmp_path / "a.stl")
    (tmp_path / "cut.stl").write_bytes((tmp_path / "a.stl").read_bytes()[:-30])
    (tmp_path / "empty.obj").write_text("v 0 0 0\n")
    (tmp_path / "mine").mkdir()
    with pytest.raises(InputError, match=sentence):
        import_scene(tmp_path / name, tmp_path / out, **(AT_600 | options))
    assert not [*(tmp_path / "mine").iterdir(), *tmp_path.glob("out")]

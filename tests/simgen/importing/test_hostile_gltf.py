"""glTF files that are damaged or made to harm: one sentence each, and nothing is written."""

import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_draft import QUAD_UV, GltfDraft, glb
from hostile_files import png

from pcii.base import InputError
from simgen.importing import import_scene

AT_600: dict[str, Any] = {"place_at_mm": (0.0, 0.0, 600.0)}


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


def with_picture(content: bytes) -> bytes:
    draft = GltfDraft()
    picture = {"baseColorTexture": {"index": draft.texture(content)}}
    draft.node(mesh=draft.mesh(uv=QUAD_UV, material={"pbrMetallicRoughness": picture}))
    return draft.glb()


NAN = np.array([(0, 0, 0), (1, 0, 0), (0, np.nan, 0), (0, 1, 0)], "<f4")
BOMB = png(60_000, zlib.compress(bytes(1 << 20)))
FILES: dict[str, tuple[bytes, str]] = {
    "no JSON": (b"\x00\x01\x02 this is no scene", "not a glTF file"),
    "version 1": (b'{"asset": {"version": "1.0"}}', r"'asset.version'.* got '1.0'"),
    "NaN in a range": (changed("materials", [{"alphaCutoff": float("nan")}]), r"materials\[0\].alphaCutoff"),
    "cut off": (plate().glb()[:300], "cut off"),
    "http": (with_uri("http://example.org/a.bin"), "there is no file"),
    "absolute": (with_uri("/etc/passwd"), "lies outside"),
    "outside, encoded": (with_uri("%2e%2e/%2e%2e/etc/passwd"), "lies outside"),
    "bad base64": (with_uri("data:;base64,%%%"), "base64"),
    "short buffer": (with_uri("data:;base64,AAAA"), r"accessors\[0\]: its 4 elements do not fit"),
    "10^8 zeros": (
        changed("accessors.0", {"componentType": 5126, "count": 10**8, "type": "VEC3"}),
        "at most 4194304 elements of VEC3 .* got 100000000",
    ),
    "no such accessor": (changed("meshes.0.primitives.0.indices", 99), r"no accessors\[99\]"),
    "index beyond": (changed("accessors.0.count", 3), "vertex 3, but only"),
    "NaN vertices": (plate(positions=NAN).glb(), r"accessors\[0\]: has numbers that are nan"),
    "a circle of nodes": (changed("nodes.0.children", [0]), "stands in a circle"),
    "Draco": (
        changed("extensionsRequired", ["KHR_draco_mesh_compression"]),
        "KHR_draco_mesh_compression; export it without compression",
    ),
    "picture bomb": (with_picture(BOMB), r"images\[0\]: "),
    "nothing": (b'{"asset": {"version": "2.0"}}', "no surface"),
}


@pytest.mark.parametrize("name", FILES)
def test_one_sentence_says_what_is_wrong(name: str, tmp_path: Path) -> None:
    content, sentence = FILES[name]
    path = tmp_path / "scene.glb"
    path.write_bytes(content)
    with pytest.raises(InputError, match=sentence) as refused:
        import_scene(path, tmp_path / "out", **AT_600)
    text = str(refused.value)
    assert text.startswith(str(path))
    assert "\n" not in text
    assert len(text) < 700
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"unit": "mile"}, "unit: expected one of mm, cm, m, in, ft, got 'mile'"),
        ({"emission_unit": "lumen"}, "emission_unit: expected nit, or watt for a glTF file, got 'lumen'"),
        ({"camera": "left"}, "give camera or place_at_mm, not both"),
    ],
)
def test_options_that_make_no_sense_are_refused(
    tmp_path: Path, options: dict[str, Any], sentence: str
) -> None:
    (tmp_path / "a.glb").write_bytes(plate().glb())
    with pytest.raises(InputError, match=sentence):
        import_scene(tmp_path / "a.glb", tmp_path / "out", **(AT_600 | options))


def test_nothing_of_the_users_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(plate().glb())
    (tmp_path / "out").mkdir()
    with pytest.raises(InputError, match="out: is there already"):
        import_scene(tmp_path / "a.glb", tmp_path / "out", **AT_600)
    with pytest.raises(InputError, match=r"expected a glTF file \(.glb or .gltf\)"):
        import_scene(tmp_path / "a.fbx", tmp_path / "other")
    with pytest.raises(InputError, match="there is no such file"):
        import_scene(tmp_path / "b.glb", tmp_path / "other")

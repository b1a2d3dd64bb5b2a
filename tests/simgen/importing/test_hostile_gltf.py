"""glTF files that are damaged or made to harm: one sentence each, and nothing is written."""

import json
import struct
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_draft import QUAD_UV, GltfDraft, glb
from hostile_files import png

from pcii.base.errors import InputError
from simgen.importing.scene_import import import_scene

LIMIT_S = 2.0
AT_600: dict[str, Any] = {"place_at_mm": (0.0, 0.0, 600.0)}


def plate() -> GltfDraft:
    draft = GltfDraft()
    draft.node(mesh=draft.mesh(uv=QUAD_UV), name="plate")
    return draft


def with_json(change: Callable[[dict[str, Any]], None]) -> bytes:
    """A sound binary file whose JSON is changed."""
    draft = plate()
    document = json.loads(json.dumps(draft.document()))
    change(document)
    return glb(json.dumps(document).encode(), draft.bytes)


def with_uri(uri: str) -> bytes:
    return with_json(lambda document: document["buffers"].__setitem__(0, {"uri": uri, "byteLength": 4}))


def changed(path: str, value: Any) -> bytes:
    """With a value at a dotted path."""

    def change(document: dict[str, Any]) -> None:
        *steps, last = [int(step) if step.isdigit() else step for step in path.split(".")]
        target: Any = document
        for step in steps:
            target = target[step]
        target[last] = value

    return with_json(change)


def with_picture(content: bytes) -> bytes:
    draft = GltfDraft()
    picture = {"baseColorTexture": {"index": draft.texture(content)}}
    draft.node(mesh=draft.mesh(uv=QUAD_UV, material={"pbrMetallicRoughness": picture}))
    return draft.glb()


def with_nan() -> bytes:
    draft = GltfDraft()
    positions = np.array([(0, 0, 0), (1, 0, 0), (0, np.nan, 0)], "<f4")
    draft.node(mesh=draft.mesh(positions, np.array([0, 1, 2], "<u2")))
    return draft.glb()


def chain(length: int) -> bytes:
    def change(document: dict[str, Any]) -> None:
        document["nodes"] = [{"children": [number + 1]} for number in range(length)] + [{"mesh": 0}]

    return with_json(change)


def requires(*names: str) -> bytes:
    return changed("extensionsRequired", list(names))


BOMB = png(width=60_000, height=60_000, data=zlib.compress(bytes(1 << 20)))
FILES: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "not a glTF file"),
    "no JSON": (b"\x00\x01\x02 this is no scene", "not a glTF file"),
    "not UTF-8": (b'{"asset": "\xff"}', "not a glTF file"),
    "a list": (b"[]", "no asset.version"),
    "version 1": (b'{"asset": {"version": "1.0"}}', "glTF of version 1.0"),
    "nested deeply": (b'{"asset":' + b"[" * 100_000, "nested too deeply|not a glTF file"),
    "many parts": (
        b'{"asset":{"version":"2.0"},"nodes":[' + b"[]," * 1_500_000 + b"[]]}",
        "more than 2000000",
    ),
    "NaN in JSON": (b'{"asset": {"version": "2.0"}, "nodes": [{"scale": [NaN, 1, 1]}]}', "NaN"),
    "1e999": (b'{"asset": {"version": "2.0"}, "nodes": [{"scale": [1e999, 1, 1]}]}', r"nodes\[0\].scale"),
    "cut off": (plate().glb()[:300], "cut off"),
    "no JSON part": (struct.pack("<4sII", b"glTF", 2, 12), "without its JSON part"),
    "http": (with_uri("http://example.org/a.bin"), "only files beside the scene's"),
    "file": (with_uri("file:///etc/passwd"), "only files beside the scene's"),
    "absolute": (with_uri("/etc/passwd"), "only files beside the scene's"),
    "outside": (with_uri("../../../etc/passwd"), "lies outside"),
    "outside, encoded": (with_uri("%2e%2e/%2e%2e/etc/passwd"), "lies outside"),
    "a device": (with_uri("../../../dev/zero"), "lies outside"),
    "missing": (with_uri("gone.bin"), "there is no file 'gone.bin'"),
    "bad base64": (with_uri("data:;base64,%%%"), "base64"),
    "short buffer": (changed("buffers.0.byteLength", 10_000), r"buffers\[0\]: has \d+ bytes"),
    "view beyond": (changed("bufferViews.0.byteLength", 10_000), r"bufferViews\[0\]: ends at byte"),
    "accessor beyond": (changed("accessors.0.count", 1000), r"accessors\[0\]: its 1000 elements"),
    "10^8 indices": (changed("accessors.2.count", 10**8), "has 100000000 elements"),
    "10^8 zeros": (
        changed("accessors.0", {"componentType": 5126, "count": 10**8, "type": "VEC3"}),
        "at most",
    ),
    "negative": (changed("accessors.0.byteOffset", -4), "byteOffset"),
    "no such accessor": (changed("meshes.0.primitives.0.indices", 99), r"no accessors\[99\]"),
    "index beyond": (changed("accessors.0.count", 3), "3 elements|vertex 3"),
    "wrong type": (changed("accessors.0.type", "VEC2"), "is a VEC2; a VEC3 is needed"),
    "NaN vertices": (with_nan(), "nan"),
    "a circle of nodes": (changed("nodes.0.children", [0]), "stands in a circle"),
    "10^4 nodes deep": (chain(10_000), "more than 500"),
    "no such mesh": (changed("nodes.0.mesh", 7), r"no meshes\[7\]"),
    "Draco": (requires("KHR_draco_mesh_compression"), "KHR_draco_mesh_compression.*without compression"),
    "meshopt": (
        requires("EXT_meshopt_compression", "KHR_texture_basisu"),
        "needs EXT_meshopt_compression; export it without compression",
    ),
    "picture bomb": (with_picture(BOMB), r"images\[0\]: "),
    "no picture": (with_picture(b"GIF89a"), r"images\[0\]: not a PNG, JPEG or TIFF"),
    "nothing": (b'{"asset": {"version": "2.0"}}', "no surface"),
}


@pytest.mark.parametrize("name", FILES)
def test_one_sentence_says_what_is_wrong(name: str, tmp_path: Path) -> None:
    content, sentence = FILES[name]
    path = tmp_path / "scene.glb"
    path.write_bytes(content)
    began = time.perf_counter()
    with pytest.raises(InputError, match=sentence) as refused:
        import_scene(path, tmp_path / "out", place_at_mm=(0.0, 0.0, 600.0))
    assert time.perf_counter() - began < LIMIT_S
    text = str(refused.value)
    assert text.startswith(str(path))
    assert "\n" not in text
    assert len(text) < 700
    assert not (tmp_path / "out").exists()


def test_a_sound_file_is_read(tmp_path: Path) -> None:
    """What all of them are but for one fault."""
    (tmp_path / "a.glb").write_bytes(plate().glb())
    assert import_scene(tmp_path / "a.glb", tmp_path / "out", place_at_mm=(0.0, 0.0, 600.0)).triangles == 2


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"fit_mm": 0.0}, "--fit-mm: expected a length above 0, got 0"),
        ({"unit": "mile"}, "--unit: expected one of mm, cm, m, in, ft, got 'mile'"),
        ({"emission_unit": "lumen"}, "--emission-unit: expected one of nit, watt, got 'lumen'"),
        ({"place_at_mm": (0.0, 0.0, float("nan"))}, "--place-at-mm: expected three finite numbers"),
        ({"place_at_mm": (0.0, 0.0, 1e9)}, "position_mm"),
    ],
)
def test_options_that_make_no_sense_are_told(tmp_path: Path, options: dict[str, Any], sentence: str) -> None:
    (tmp_path / "a.glb").write_bytes(plate().glb())
    with pytest.raises(InputError, match=sentence):
        import_scene(tmp_path / "a.glb", tmp_path / "out", **(AT_600 | options))


def test_nothing_of_the_users_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(plate().glb())
    (tmp_path / "out").mkdir()
    with pytest.raises(InputError, match="out: is there already"):
        import_scene(tmp_path / "a.glb", tmp_path / "out", place_at_mm=(0.0, 0.0, 600.0))
    with pytest.raises(InputError, match=r"expected a glTF file \(.glb or .gltf\)"):
        import_scene(tmp_path / "a.obj", tmp_path / "other")
    with pytest.raises(InputError, match="there is no such file"):
        import_scene(tmp_path / "b.glb", tmp_path / "other")
    with pytest.raises(InputError, match="--emission-unit: is for glTF files"):
        import_scene(tmp_path / "a.xml", tmp_path / "other", emission_unit="watt")

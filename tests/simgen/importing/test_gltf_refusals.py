"""glTF files that cannot be imported: one sentence each, and nothing is written."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_draft import QUAD_UV, GltfDraft, glb

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


NAN = np.array([(0, 0, 0), (1, 0, 0), (0, np.nan, 0), (0, 1, 0)], "<f4")
FILES: dict[str, tuple[bytes, str]] = {
    "no JSON": (b"\x00\x01\x02 this is no scene", "not a glTF file"),
    "version 1": (b'{"asset": {"version": "1.0"}}', r"'asset.version'.* got '1.0'"),
    "cut off": (plate().glb()[:300], "cut off"),
    "http": (with_uri("http://example.org/a.bin"), "there is no file"),
    "outside, encoded": (with_uri("%2e%2e/%2e%2e/etc/passwd"), "lies outside"),
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
    ],
)
def test_wrong_names_and_options_are_refused(
    tmp_path: Path, name: str, out: str, options: dict[str, Any], sentence: str
) -> None:
    (tmp_path / "a.glb").write_bytes(plate().glb())
    (tmp_path / "mine").mkdir()
    with pytest.raises(InputError, match=sentence):
        import_scene(tmp_path / name, tmp_path / out, **(AT_600 | options))
    assert not [*(tmp_path / "mine").iterdir(), *tmp_path.glob("out")]

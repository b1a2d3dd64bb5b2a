"""glTF files as scenes: where things stand, what they look like, and what is reported of the rest."""

import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_draft import QUAD, QUAD_UV, GltfDraft
from lit_scenes import film
from PIL import Image
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial.transform import Rotation

from pcii.base import InputError, linear_to_srgb, srgb_to_linear
from simgen.assets import read_assets, triangles_of
from simgen.importing import import_scene
from simgen.renderer import backend, build, render_view
from simgen.spec import Scene, load_scene
from simgen.truth import first_hits_at_centre

RNG = np.random.default_rng(5)
TETRAHEDRON = np.array([(0, 0, 0), (1, 0, 0), (0, 2, 0), (0, 0, 3)], "<f4") / 20
TETRAHEDRON_FACES = np.array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], "<u1")


def imported(draft: GltfDraft, folder: Path, **options: Any) -> tuple[Scene, tuple[str, ...]]:
    """The scene of a draft, and what could not be represented."""
    folder.mkdir(exist_ok=True)
    for material in draft.json.get("materials", []):
        material.setdefault("doubleSided", True)
    (folder / "file.glb").write_bytes(draft.glb())
    report = import_scene(folder / "file.glb", folder / "scene", **options)
    return load_scene(str(folder / "scene")), report.left_out


def corners_mm(scene: Scene, folder: Path, name: str) -> np.ndarray:
    """Vertices (N, 3) of an object in the world."""
    thing = next(thing for thing in scene.objects if thing.name == name)
    mesh = triangles_of(thing.shape, read_assets(scene, folder).meshes)
    turned = Rotation.from_euler("xyz", thing.rotation_deg, degrees=True)
    return turned.apply(mesh.positions.astype(np.float64)) + thing.position_mm


def turn(x: float, y: float, z: float) -> np.ndarray:
    """A rotation (3, 3) about X, then Y, then Z, in degrees."""
    return Rotation.from_euler("xyz", (x, y, z), degrees=True).as_matrix()


def affine(linear: np.ndarray, move: tuple[float, float, float]) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, move
    return matrix


def by_columns(matrix: np.ndarray) -> list[float]:
    return matrix.T.ravel().tolist()


PLACES = {
    "turned": affine(turn(20, 50, -70), (0.1, -0.05, -0.6)),
    "mirrored": affine(turn(10, 0, 30) @ np.diag([-1.5, 0.7, 1.2]), (-0.1, 0.05, -0.7)),
    "turned over": affine(turn(180, 0, 90) @ np.diag([2.0, 2.0, 2.0]), (0.0, 0.0, -0.8)),
    "sheared": affine(np.diag([1.0, 2.0, 1.0]) @ turn(0, 0, 40), (0.1, 0.1, -0.9)),
    "Y by a right angle": affine(turn(30, 90, 10), (0.0, 0.1, -0.5)),
}


@pytest.mark.renders
def test_everything_stands_where_the_file_says(tmp_path: Path) -> None:
    """The camera looks along its -Z with Y up; ours along +Z with Y down."""
    draft = GltfDraft()
    mesh = draft.mesh(TETRAHEDRON, TETRAHEDRON_FACES)
    outer = affine(turn(5, -20, 15), (0.3, 0.2, -0.1))
    placed = {"root": False, "mesh": mesh}
    children = [draft.node(name=name, matrix=by_columns(place), **placed) for name, place in PLACES.items()]
    draft.node(name="group", matrix=by_columns(outer), children=children)
    eye = affine(turn(8, 12, -5), (0.05, 0.1, 0.2))
    draft.camera(matrix=by_columns(eye @ np.diag([2.0, 2.0, 2.0, 1.0])), yfov=0.5, aspect=1.5)
    scene, left_out = imported(draft, tmp_path)
    assert left_out == ("the file has no light: the scene is lit evenly from all around",)
    to_ours = np.diag([1000.0, -1000.0, -1000.0, 1.0]) @ np.linalg.inv(eye)
    corners = np.column_stack([TETRAHEDRON, np.ones(4)])
    for name, place in PLACES.items():
        expected = (corners @ (to_ours @ outer @ place).T)[:, :3]
        found = corners_mm(scene, tmp_path / "scene", name.replace(" ", "-"))
        np.testing.assert_allclose(found, expected, atol=1e-3)
    # One file for all but the one that a rotation and scales cannot make.
    assert len(list((tmp_path / "scene").glob("*.ply"))) == 2


@pytest.mark.renders
@pytest.mark.parametrize("place", ["mirrored", "sheared"])
def test_the_outside_stays_outside(tmp_path: Path, place: str) -> None:
    """A closed mesh that shines is dark inside: seen from without each visible side is bright."""
    draft = GltfDraft()
    glow = {"emissiveFactor": [1.0, 1.0, 1.0], "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]}}
    mesh = draft.mesh(TETRAHEDRON, TETRAHEDRON_FACES, material=glow)
    draft.node(mesh=mesh, name="lamp", matrix=by_columns(PLACES[place]))
    draft.camera()
    scene, _ = imported(draft, tmp_path)
    built = build(backend.load(), scene, tmp_path / "scene", 2)
    grid = film(64, 64, focal_mm=125)
    hit = first_hits_at_centre(built, grid).object_id == 1
    assert hit.sum() > 50
    view = render_view(built, grid, 0, 0, samples_per_pixel=1, seed=1)
    # But for rays beside the edges of the lamp.
    assert (view[hit] >= 0.99).mean() > 0.9


def test_a_scene_without_a_camera_is_placed_and_fitted(tmp_path: Path) -> None:
    draft = GltfDraft()
    draft.node(mesh=draft.mesh(np.array([(0, 0, 0), (4, 0, 0), (4, 2, 0), (0, 2, 1)], "<f4")), name="plate")
    with pytest.raises(InputError, match=r"--place-at-mm: .*has no camera.*such as --place-at-mm 0 0 "):
        imported(draft, tmp_path)
    scene, _ = imported(draft, tmp_path, place_at_mm=(10.0, 20.0, 600.0), fit_mm=100.0)
    found = corners_mm(scene, tmp_path / "scene", "plate")
    # Y is up and Z towards the viewer in the file; 4 m become 100 mm.
    expected = np.array([(-40, 45, 612.5), (60, 45, 612.5), (60, -5, 612.5), (-40, -5, 587.5)])
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_one_of_several_cameras_is_chosen_by_name(tmp_path: Path) -> None:
    draft = GltfDraft()
    draft.node(mesh=draft.mesh(), name="plate", translation=[0, 0, -1])
    draft.camera(name="left", translation=[-0.1, 0, 0])
    draft.camera(name="right", translation=[0.1, 0, 0])
    for camera in (None, "rigth"):
        with pytest.raises(InputError, match=r"--camera: .* has the cameras left, right; choose one"):
            imported(draft, tmp_path, camera=camera)
    scene, _ = imported(draft, tmp_path, camera="right", unit="cm")
    assert scene.objects[0].position_mm == (-1.0, 0.0, 10.0)


def test_lights_keep_their_candela_and_lux(tmp_path: Path) -> None:
    draft = GltfDraft()
    draft.node(mesh=draft.mesh(), name="plate", translation=[0, 0, -1])
    draft.camera()
    down = {"rotation": [-np.sqrt(0.5), 0, 0, np.sqrt(0.5)]}  # -Z comes to -Y
    draft.light({"type": "point", "intensity": 10.0, "color": [1.0, 0.5, 0.25]}, translation=[0.1, 0.2, -0.3])
    draft.light({"type": "directional", "intensity": 300.0}, **down)
    cone = {"innerConeAngle": np.radians(10), "outerConeAngle": np.radians(25)}
    draft.light({"type": "spot", "intensity": 7.0, "spot": cone}, translation=[0, 1, -1], **down)
    draft.light({"type": "point", "intensity": 0.0})
    scene, _ = imported(draft, tmp_path)
    lights: Any = scene.lights
    point, sun, spot = lights
    assert [light.type for light in lights] == ["point", "directional", "spot"]
    assert point.position_mm == (100.0, -200.0, 300.0)
    assert point.intensity_cd == pytest.approx(10 * (0.2126 + 0.7152 / 2 + 0.0722 / 4))
    assert point.illuminant == pytest.approx(linear_to_srgb(np.array([1, 0.5, 0.25])), abs=1e-6)
    assert sun.illuminance_lux == 300
    np.testing.assert_allclose(sun.direction, (0, 1, 0), atol=1e-9)
    assert (spot.beam_deg, spot.cutoff_deg) == pytest.approx((10, 25))
    assert spot.intensity_cd == 7
    np.testing.assert_allclose(np.subtract(spot.target_mm, spot.position_mm), (0, 100, 0), atol=1e-6)
    # A scene that is made twice as large keeps the light on its surfaces: at twice the distance.
    other, _ = imported(draft, tmp_path / "large", place_at_mm=(0.0, 0.0, 900.0), fit_mm=4000.0)
    assert other.lights[0].intensity_cd == pytest.approx(4 * point.intensity_cd)  # type: ignore[union-attr]


def test_emission_in_watts_has_blenders_ratio_to_its_lights(tmp_path: Path) -> None:
    """In Blender a lamp of P watts sends P / (4 pi) W/sr, a sun brings S W/m^2, a surface sends s W/(sr m^2).

    The exporter's lighting mode Standard multiplies the first two by 683 lm/W, and writes s as it is.
    """
    watts, sun_w_m2, strength = 5.0, 2.0, 40.0
    draft = GltfDraft()
    glow: dict[str, Any] = {
        "emissiveFactor": [1.0, 1.0, 1.0],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": strength}},
    }
    draft.node(mesh=draft.mesh(uv=QUAD_UV, material=glow), name="panel", translation=[0, 0, -1])
    draft.camera()
    draft.light({"type": "point", "intensity": 683 * watts / (4 * np.pi)})
    draft.light({"type": "directional", "intensity": 683 * sun_w_m2})
    for unit, factor in (("watt", 1.0), ("nit", 683.0)):
        options = {} if unit == "nit" else {"emission_unit": unit}
        scene, left_out = imported(draft, tmp_path / unit, **options)
        emission: Any = scene.objects[0].material.emission
        lights: Any = scene.lights
        bulb, sun = lights
        per_m2 = emission.luminance_cd_m2 / bulb.intensity_cd
        assert per_m2 == pytest.approx(strength / (watts / (4 * np.pi)) / factor, rel=1e-6)
        per_sr = emission.luminance_cd_m2 / sun.illuminance_lux
        assert per_sr == pytest.approx(strength / sun_w_m2 / factor, rel=1e-6)
        assert [what.endswith("--emission-unit watt") for what in left_out] == [True] * (unit == "nit")


def png(pixels: np.ndarray) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "png")
    return file.getvalue()


def pixels_of(folder: Path, name: str | None) -> np.ndarray:
    assert isinstance(name, str)
    return np.array(Image.open(folder / name))


def material_of(
    material: dict[str, Any], folder: Path, draft: GltfDraft | None = None
) -> tuple[Any, tuple[str, ...]]:
    """The material of a square that has this one in the file."""
    draft = draft or GltfDraft()
    draft.node(mesh=draft.mesh(uv=QUAD_UV, material={"name": "m", **material}), translation=[0, 0, -1])
    draft.light({"type": "point", "intensity": 1.0})
    scene, left_out = imported(draft, folder, place_at_mm=(0.0, 0.0, 600.0))
    return scene.objects[0].material, left_out


def test_numbers_of_materials(tmp_path: Path) -> None:
    base = {"baseColorFactor": [0.5, 0.25, 1.0, 1.0], "metallicFactor": 0.25, "roughnessFactor": 0.4}
    material = {
        "pbrMetallicRoughness": base,
        "emissiveFactor": [2.0, 1.0, 0.0],  # above 1, as before KHR_materials_emissive_strength
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 0.3},
            "KHR_materials_ior": {"ior": 1.4},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.6, "clearcoatRoughnessFactor": 0.2},
            "KHR_materials_emissive_strength": {"emissiveStrength": 40.0},
        },
    }
    made, _ = material_of(material, tmp_path)
    assert made.reflectance == pytest.approx(linear_to_srgb(np.array([0.5, 0.25, 1.0])), abs=1e-6)
    finish = made.finish
    assert (finish.metallic, finish.roughness, finish.transmission) == (0.25, 0.4, 0.3)
    assert (finish.refractive_index, finish.clearcoat) == (1.4, 0.6)
    # The widths of the coat's highlights agree: alpha is 0.2^2, and 0.1 to 0.001 over the gloss.
    assert 0.1 + finish.clearcoat_gloss * (0.001 - 0.1) == pytest.approx(0.04, abs=1e-6)
    assert made.emission.luminance_cd_m2 == pytest.approx(80 * (0.2126 + 0.7152 / 2))
    specular = {"KHR_materials_specular": {"specularFactor": 0.25}}
    made, _ = material_of({"extensions": specular}, tmp_path / "glossy")
    n = made.finish.refractive_index  # at normal incidence ((n - 1) / (n + 1))^2 times the factor
    assert ((n - 1) / (n + 1)) ** 2 == pytest.approx(0.04 * 0.25, rel=1e-4)


def test_pictures_are_split_and_multiplied(tmp_path: Path) -> None:
    draft = GltfDraft()
    colours = RNG.integers(0, 256, (4, 4, 3), dtype=np.uint8)
    packed = RNG.integers(0, 256, (4, 4, 3), dtype=np.uint8)
    tilts = np.full((4, 4, 3), (128, 128, 255), np.uint8)
    colour, numbers, tilt = (draft.texture(png(pixels)) for pixels in (colours, packed, tilts))
    numbers_of_surface = {"baseColorTexture": {"index": colour}, "baseColorFactor": [1.0, 0.5, 0.25, 1.0]}
    numbers_of_surface |= {"metallicRoughnessTexture": {"index": numbers}, "metallicFactor": 0.5}
    material = {"pbrMetallicRoughness": numbers_of_surface, "normalTexture": {"index": tilt}}
    made, left_out = material_of(material, tmp_path, draft)
    folder = tmp_path / "scene"
    linear = srgb_to_linear(pixels_of(folder, made.texture) / 255)
    expected = srgb_to_linear(colours / 255) * [1, 0.5, 0.25]
    # Half a step of 8 bits, at most 2.3 times as much in linear light.
    np.testing.assert_allclose(linear, expected, atol=2.3 * 0.51 / 255)
    np.testing.assert_array_equal(pixels_of(folder, made.finish.roughness), packed[..., 1])
    np.testing.assert_allclose(pixels_of(folder, made.finish.metallic), packed[..., 2] / 2, atol=0.5)
    np.testing.assert_array_equal(pixels_of(folder, made.normal_map), tilts)
    assert left_out == ()


@pytest.mark.parametrize(("mode", "cutoff"), [("MASK", 0.3), ("BLEND", 0.5)])
def test_alpha_cuts_holes(tmp_path: Path, mode: str, cutoff: float) -> None:
    pixels = RNG.integers(0, 256, (8, 8, 4), dtype=np.uint8)

    def made_with(alpha: dict[str, Any], folder: Path) -> tuple[Any, tuple[str, ...]]:
        draft = GltfDraft()
        picture = {"baseColorTexture": {"index": draft.texture(png(pixels))}}
        return material_of({"pbrMetallicRoughness": picture, **alpha}, folder, draft)

    made, left_out = made_with({"alphaMode": mode, "alphaCutoff": 0.3}, tmp_path)
    opacity = pixels_of(tmp_path / "scene", made.opacity) / 255
    np.testing.assert_array_equal(opacity >= 0.5, pixels[..., 3] / 255 >= cutoff)
    assert ("partly clear" in "".join(left_out)) == (mode == "BLEND")
    opaque, _ = made_with({"alphaMode": "OPAQUE"}, tmp_path / "opaque")
    assert opaque.opacity is None


COLOURS = np.array([[(255, 0, 0), (0, 255, 0)], [(0, 0, 255), (255, 255, 255)]], np.uint8)
QUARTERS = COLOURS.repeat(8, axis=0).repeat(8, axis=1)
LETTERS = {(True, False, False): "R", (False, True, False): "G", (False, False, True): "B", (True,) * 3: "W"}


@pytest.mark.renders
@pytest.mark.parametrize(
    ("transform", "seen"),
    [
        ({}, "RG BW"),
        # Texture coordinates turned counterclockwise, and so the picture clockwise about its upper left.
        ({"rotation": np.pi / 2, "offset": [0.0, 1.0]}, "BR WG"),
        ({"scale": [-1.0, 1.0]}, "GR WB"),
    ],
)
def test_pictures_lie_as_in_the_file(tmp_path: Path, transform: dict[str, Any], seen: str) -> None:
    draft = GltfDraft()
    info: dict[str, Any] = {"index": draft.texture(png(QUARTERS))}
    if transform:
        info["extensions"] = {"KHR_texture_transform": transform}
    material = {"pbrMetallicRoughness": {"baseColorTexture": info, "metallicFactor": 0.0}}
    draft.node(mesh=draft.mesh(QUAD, uv=QUAD_UV, material=material), translation=[0, 0, -4])
    draft.camera()
    scene, _ = imported(draft, tmp_path)
    built = build(backend.load(), scene, tmp_path / "scene", 2)
    grid = film(4, 4, focal_mm=8)
    view = render_view(built, grid, 0, 0, samples_per_pixel=64, seed=1)
    found = [[LETTERS[tuple((view[i, j] > 0.5 * view.max()).tolist())] for j in (1, 2)] for i in (1, 2)]
    assert " ".join("".join(row) for row in found) == seen


def test_a_glow_needs_a_place_for_each_pixel(tmp_path: Path) -> None:
    fan = np.vstack([QUAD, [(0, 0, 0)]]).astype("<f4")
    faces = np.array([0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4], "<u2")
    layouts = {"once": [*QUAD_UV, (0.5, 0.5)], "twice": [(0, 0), (1, 0), (0, 0), (1, 0), (0.5, 1)]}
    for name, uv in layouts.items():
        draft = GltfDraft()
        glow = {"emissiveFactor": [1.0, 1.0, 1.0], "emissiveTexture": {"index": draft.texture(png(QUARTERS))}}
        draft.node(mesh=draft.mesh(fan, faces, np.array(uv, "<f4"), glow), translation=[0, 0, -4])
        scene, left_out = imported(draft, tmp_path / name, place_at_mm=(0.0, 0.0, 600.0))
        assert (scene.objects[0].material.emission is not None) == (name == "once")
        assert any("shine" in what for what in left_out) == (name == "twice")


def test_parts_of_a_mesh_are_objects_named_by_their_materials(tmp_path: Path) -> None:
    draft = GltfDraft()
    mesh = draft.mesh(material={"name": "oak"})
    first = draft.json["meshes"][mesh]["primitives"][0]
    draft.json["meshes"][mesh]["primitives"] += [
        first | {"material": draft.put("materials", {"name": "steel"})},
        {"attributes": first["attributes"], "mode": 0},
        {"attributes": first["attributes"], "mode": 6},
    ]
    draft.node(mesh=mesh, name="table.001")
    draft.node(mesh=mesh, name="table.001", translation=[0, 0, -1])
    place: dict[str, Any] = {"place_at_mm": (0.0, 0.0, 900.0)}
    with pytest.raises(InputError, match="no object 'table-001'; it has table-001-oak, table-001-steel, "):
        imported(draft, tmp_path, unscored=["table-001"], **place)
    scene, left_out = imported(draft, tmp_path, unscored=["table-001-4", "table-001-oak-2"], **place)
    assert [thing.scored for thing in scene.objects] == [True, True, False, False, True, True]
    parts = "table-001-oak", "table-001-steel", "table-001-4"
    assert [thing.name for thing in scene.objects] == [*parts, *(f"{name}-2" for name in parts)]
    assert "points and lines, which have no surface" in left_out
    assert len(list((tmp_path / "scene").glob("*.ply"))) == 3


def test_text_and_binary_files_are_one(tmp_path: Path) -> None:
    draft = GltfDraft()
    draft.node(mesh=draft.mesh(uv=QUAD_UV, material={"doubleSided": True}), name="plate")
    draft.camera(translation=[0, 0, 3])
    for name in "abc":
        (tmp_path / name).mkdir()
    (tmp_path / "a" / "x.glb").write_bytes(draft.glb())
    (tmp_path / "b" / "x.gltf").write_bytes(b"\xef\xbb\xbf" + draft.gltf())  # a byte order mark
    apart = draft.document()
    apart["buffers"][0]["uri"] = "numbers%201.bin"
    (tmp_path / "c" / "numbers 1.bin").write_bytes(draft.bytes)
    (tmp_path / "c" / "x.gltf").write_text(json.dumps(apart))
    written: list[dict[str, bytes]] = []
    for name in ("a/x.glb", "b/x.gltf", "c/x.gltf"):
        folder = import_scene(tmp_path / name, tmp_path / f"scene{len(written)}").folder
        written.append({path.name: path.read_bytes() for path in folder.iterdir()})
    assert written[0] == written[1] == written[2]


def test_what_the_file_says_and_the_scene_does_not_have_is_named(tmp_path: Path) -> None:
    """Of nodes, meshes, materials, pictures, cameras and of the file itself, each once."""
    draft = GltfDraft()
    texture = draft.texture(png(QUARTERS), magFilter=9728, wrapS=33071, wrapT=10497)
    base = {"baseColorTexture": {"index": texture}, "roughnessFactor": 1.0000001, "metallicFactor": -1e-9}
    material = {"name": "m", "pbrMetallicRoughness": base, "doubleSided": False} | {
        "occlusionTexture": {"index": texture},
        "extensions": {"KHR_materials_unlit": {}, "KHR_materials_sheen": {}, "KHR_materials_ior": {"ior": 9}},
    }
    draft.node(mesh=draft.mesh(uv=QUAD_UV, material=material), name="with")
    without = draft.mesh(material=material)
    draft.json["meshes"][without] |= {"primitives": draft.json["meshes"][without]["primitives"] * 2}
    draft.json["meshes"][without]["primitives"][1] |= {"targets": [{}], "extensions": {"EXT_of_mesh": {}}}
    draft.node(mesh=without, name="without", extensions={"EXT_of_node": {"much": [1, 2]}}, extras={"a": 1})
    draft.node(mesh=without, name="nothing", scale=[0, 0, 0])
    draft.put("scenes", {"nodes": [draft.node(root=False, mesh=without, name="of another scene")]})
    draft.node(camera=draft.put("cameras", {"type": "orthographic", "orthographic": {}}))
    draft.light({"type": "spot", "range": 3.0, "color": [-1, 0, 1], "spot": {"outerConeAngle": 3.0}})
    draft.json |= {"animations": [{}], "extensionsUsed": ["EXT_of_file", "KHR_materials_ior"]}
    draft.json["extensionsRequired"] = ["KHR_xmp_json_ld"]
    scene, left_out = imported(draft, tmp_path, place_at_mm=(0.0, 0.0, 600.0))
    assert [thing.material.texture is not None for thing in scene.objects] == [True, False, False]
    assert scene.objects[0].material.finish.roughness == 1  # type: ignore[union-attr]
    assert set(left_out) == {
        "roughnessFactor of 1.0000001, taken as 1.0",
        "metallicFactor of -1e-09, taken as 0.0",
        "color of [-1, 0, 1], taken as [0.0, 0, 1]",
        "outerConeAngle of 3.0, taken as 1.553",
        *("occlusionTexture", "targets", "orthographic", "range", "animations", "magFilter NEAREST"),
        *("KHR_materials_unlit", "KHR_materials_sheen", "KHR_xmp_json_ld"),
        *("EXT_of_mesh", "EXT_of_node", "EXT_of_file"),
        "backs of one-sided surfaces, which look like their fronts (doubleSided)",
        "pictures that are repeated along one side alone: they are along both (material 'm')",
        "pictures on meshes without texture coordinates for them (material 'm')",
        "ior of 9, taken as 3.0",
        "1 more scenes of the file",
        "'nothing', which is scaled to nothing, or moved or scaled beyond numbers that can be rendered",
    }


@pytest.mark.renders
def test_copies_and_skins_stand_where_the_file_says(tmp_path: Path) -> None:
    draft = GltfDraft()
    mesh = draft.mesh(TETRAHEDRON, TETRAHEDRON_FACES)
    moves = np.array([(1, 0, 0), (2, 0, 0)], "<f4")
    sizes = np.array([(2, 2, 2), (3, 3, 3)], "<f4")
    attributes = {"TRANSLATION": draft.numbers(moves), "SCALE": draft.numbers(sizes)}
    copies = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    draft.node(mesh=mesh, name="post", translation=[0, 1, 0], extensions=copies)
    body = draft.mesh(TETRAHEDRON, TETRAHEDRON_FACES)
    count = len(TETRAHEDRON)
    draft.json["meshes"][body]["primitives"][0]["attributes"] |= {
        "JOINTS_0": draft.numbers(np.zeros((count, 4), "<u1")),
        "WEIGHTS_0": draft.numbers(np.tile(np.array([1, 0, 0, 0], "<f4"), (count, 1))),
    }
    bone = draft.node(name="bone", translation=[0, 0, 3])
    draft.put("skins", {"joints": [bone]})
    draft.node(mesh=body, name="body", translation=[100, 0, 0], scale=[50, 50, 50], skin=0)
    draft.camera()
    scene, _ = imported(draft, tmp_path)
    to_ours = np.array([1000, -1000, -1000])
    for number in range(2):
        expected = (TETRAHEDRON * sizes[number] + moves[number] + [0, 1, 0]) * to_ours
        found = corners_mm(scene, tmp_path / "scene", f"post-{number + 1}")
        np.testing.assert_allclose(found, expected, atol=1e-3)
    found = corners_mm(scene, tmp_path / "scene", "body")
    np.testing.assert_allclose(found, (TETRAHEDRON + np.array([0, 0, 3])) * to_ours, atol=1e-3)


BY_BLENDER = Path(__file__).parent / "by_blender"


@pytest.mark.renders
def test_depth_and_objects_are_those_that_blender_sees(tmp_path: Path) -> None:
    report = import_scene(BY_BLENDER / "scene.glb", tmp_path / "scene")
    assert (report.objects, report.lights, report.camera, report.left_out) == (6, 2, "Cam", ())
    scene = load_scene(str(tmp_path / "scene"))
    casts = np.load(BY_BLENDER / "casts.npz")
    size = len(casts["z_mm"])
    grid = replace(film(size, size), pixel_mm=36 / size)
    hits = first_hits_at_centre(build(backend.load(), scene, tmp_path / "scene", 2), grid)
    names = np.array(["", *(thing.name for thing in scene.objects)])
    theirs = np.char.replace(casts["name"], ".", "-")
    assert set(theirs.ravel()) == set(names)
    numbers = np.unique(theirs, return_inverse=True)[1].reshape(theirs.shape)
    inside = maximum_filter(numbers, 3) == minimum_filter(numbers, 3)
    assert inside.mean() > 0.8
    np.testing.assert_array_equal(names[hits.object_id][inside], theirs[inside])
    there = inside & np.isfinite(casts["z_mm"])
    assert np.abs(hits.z_mm[there] - casts["z_mm"][there]).max() < 0.05
    # The mirrored one has the mesh of the others.
    shapes = {thing.name: thing.shape for thing in scene.objects}
    files = {shapes[name].file for name in ("wedge", "turned", "mirrored")}  # type: ignore[union-attr]
    assert len(files) == 1

"""The renderer: which is chosen, and that Mitsuba's files look as it renders them and read nothing else."""

import contextlib
import importlib.util
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_runs import run_simgen
from lit_scenes import ball
from PIL import Image

import simgen
from pcii import Optics
from pcii.base import LUMINANCE, InputError
from pcii.types import CameraGrid
from simgen.renderer import backend, reference_to
from simgen.spec import MitsubaFile

SIDE, TILES, REPEATS, SAMPLES, DEPTH = 48, 8, 6, 48, 5
ANGLE_DEG, FOCAL_MM = 35.0, 50.0
SENSOR_MM = 2 * FOCAL_MM * np.tan(np.radians(ANGLE_DEG / 2))
GRID = Optics(pitch_mm=(1, 1), focal_mm=FOCAL_MM, sensor_mm=SENSOR_MM).grid((1, 1, SIDE, SIDE))
CAMERA = f"""<sensor type="perspective" id="front"><float name="fov" value="{ANGLE_DEG}"/>
<transform name="to_world"><lookat origin="0.5,0.6,4" target="0,0,0" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="{SIDE}"/><integer name="height" value="{SIDE}"/>
<string name="pixel_format" value="rgb"/><string name="component_format" value="float32"/>
<rfilter type="box"/></film></sensor>"""
ROOM = """<shape type="rectangle" id="floor"><transform name="to_world"><scale value="4"/>
<rotate x="1" angle="-90"/><translate y="-1"/></transform></shape>
<shape type="rectangle" id="back"><transform name="to_world"><scale value="6"/>
<translate z="-3"/></transform></shape>
<shape type="rectangle" id="lamp"><transform name="to_world"><scale value=".3"/><rotate x="1" angle="20"/>
<translate y="1" z="-2"/></transform><emitter type="area"><rgb name="radiance" value="9,8,7"/>
</emitter></shape>"""
GLOSSY = """<shape type="sphere" id="ball"><point name="center" x="-.7" y="-.3" z="0"/>
<float name="radius" value=".6"/><bsdf type="principled"><texture type="bitmap" name="base_color">
<string name="filename" value="picture.png"/><string name="wrap_mode" value="mirror"/>
<transform name="to_uv">
<scale x="3" y="2.5"/></transform></texture><float name="metallic" value=".3"/>
<float name="roughness" value=".4"/>
</bsdf></shape>
<shape type="shapegroup" id="group"><shape type="cube"><transform name="to_world">
<scale value=".2"/></transform>
</shape><shape type="sphere"><float name="radius" value=".15"/>
<point name="center" x="0" y=".3" z="0"/></shape></shape>
<shape type="instance" id="one"><ref id="group"/><transform name="to_world">
<translate x=".5" y="-.6"/></transform></shape>
<shape type="instance" id="two"><ref id="group"/><transform name="to_world"><rotate y="1" angle="30"/>
<scale value="1.5"/><translate x=".9" y=".2" z="-1"/></transform></shape>
<emitter type="point"><point name="position" x="2" y="3" z="2"/>
<rgb name="intensity" value="20,18,15"/></emitter>
<emitter type="spot"><transform name="to_world">
<lookat origin="-2,2,2" target="0,0,0" up="0,1,0"/></transform>
<rgb name="intensity" value="15,20,25"/></emitter>"""
FOGGY = """<medium type="homogeneous" id="fog"><float name="sigma_t" value="1.8"/>
<rgb name="albedo" value=".9,.8,.6"/>
</medium><shape type="cube" id="cloud"><transform name="to_world"><scale value=".7"/></transform>
<bsdf type="null"/><ref name="interior" id="fog"/></shape><emitter type="constant"/>"""
OBJ = '<shape type="obj"><string name="filename" value="%s"/></shape>'
DEFAULT = '<default name="d" value="."/>'
SURFACE = '<shape type="sphere"><bsdf type="%s">%s</bsdf></shape>'
PICTURE = '<texture type="bitmap" name="reflectance"/>'
BALL = ball("ball", 0, 3000, radius_mm=300)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Files that the scenes name."""
    colours = np.random.default_rng(1).integers(0, 255, (8, 8, 3), dtype=np.uint8)
    Image.fromarray(colours).save(tmp_path / "picture.png")
    return tmp_path


def scene_of(folder: Path, content: str, **values: Any) -> simgen.Scene:
    (folder / "scene.xml").write_text(f'<scene version="3.0.0">{content}</scene>')
    return simgen.load_scene({"title": "by reference", "mitsuba": "scene.xml"} | values, folder=folder)


def tiles_of(views: list[np.ndarray]) -> np.ndarray:
    """Means over tiles (N, T, T, 3)."""
    size = SIDE // TILES
    return np.array(views, dtype=np.float64).reshape(-1, TILES, size, TILES, size, 3).mean(axis=(2, 4))


@pytest.mark.renders
@pytest.mark.parametrize(
    ("content", "names", "is_thinned"), [(GLOSSY, {"ball", "one", "two"}, True), (FOGGY, {"cloud"}, False)]
)
def test_views_truth_and_photons_are_those_of_mitsuba(
    folder: Path, content: str, names: set[str], is_thinned: bool
) -> None:
    scene = scene_of(folder, CAMERA + ROOM + content)
    counts, truth = simgen.draw_photons(scene, GRID, budget=10_000, cfa=None, seed=1, max_depth=DEPTH)
    options: dict[str, Any] = {"samples_per_pixel": SAMPLES, "max_depth": DEPTH}
    views = [simgen.render(scene, GRID, seed=seed, **options).view(0, 0) for seed in range(REPEATS)]
    ours, mi = tiles_of(views), backend.load()
    file = mi.load_file(str(folder / "scene.xml"), optimize=False)
    path = mi.load_dict({"type": "path" if is_thinned else "volpath", "max_depth": DEPTH})
    seeds = range(100, 100 + REPEATS)
    theirs = tiles_of([np.array(mi.render(file, integrator=path, spp=SAMPLES, seed=seed)) for seed in seeds])
    error = np.sqrt((ours.var(axis=0, ddof=1) + theirs.var(axis=0, ddof=1)) / REPEATS)
    z = (ours.mean(axis=0) - theirs.mean(axis=0)) / error
    # Of Student's distribution with 10 degrees of freedom the mean square is 1.25, of 192 values to 15 %.
    assert (z**2).mean() < 1.8
    assert abs(ours.mean() / theirs.mean() - 1) < 0.01
    assert (truth.photons is not None) == is_thinned
    assert set(truth.names.values()) == {"floor", "back", "lamp"} | names
    luminance = theirs.mean(axis=0) @ LUMINANCE
    expected = luminance / luminance.sum() * counts.total
    size = SIDE // TILES
    drawn = counts.dense.reshape(TILES, size, TILES, size).sum(axis=(1, 3))
    assert ((drawn - expected) ** 2 / expected).sum() / (TILES**2 - 1) < 1.8
    ray, _ = file.sensors()[0].sample_ray(0.0, 0.0, mi.Point2f(0.27, 0.71), mi.Point2f(0.5))
    hit = file.ray_intersect(ray)
    row, column = int(0.71 * SIDE), int(0.27 * SIDE)
    seen = hit.instance[0] or hit.shape[0]
    assert truth.names[int(truth.object_id[row, column])] == seen.id()


@pytest.mark.renders
def test_objects_lights_and_a_level_of_the_scene_stand_beside_the_file(folder: Path) -> None:
    lamp = {"type": "point", "position_mm": [0, 0, 0], "intensity_cd": 50.0}
    without_light = CAMERA + ROOM[: ROOM.index("<shape", ROOM.index("back"))]
    scene = scene_of(folder, without_light, objects=[BALL | {"position_mm": [0, 0, 4000]}], lights=[lamp])
    view = simgen.render(scene, GRID, samples_per_pixel=16, max_depth=2).view(0, 0)
    # The nearest point of the ball faces the lamp, 3.7 m away.
    middle = view[SIDE // 2 - 1 : SIDE // 2 + 1, SIDE // 2 - 1 : SIDE // 2 + 1].mean()
    assert middle == pytest.approx(50.0 / 3.7**2 / np.pi, rel=0.02)
    _, truth = simgen.draw_photons(scene, GRID, budget=100, cfa=None)
    assert truth.z_mm[SIDE // 2, SIDE // 2] == pytest.approx(3700, abs=5)
    level = {"illuminance_lux": 1000.0, "z_mm": 4000.0}
    around = CAMERA + ROOM + '<emitter type="constant"><rgb name="radiance" value="2"/></emitter>'
    plain, levelled = (
        simgen.render(scene_of(folder, around, **values), GRID, samples_per_pixel=64, max_depth=2)
        for values in ({}, {"level": level})
    )
    # A surface gets pi times the luminance of what is around it; the lamp in view shines away from it.
    ratio = levelled.view(0, 0).mean() / plain.view(0, 0).mean()
    assert ratio == pytest.approx(1000 / (2 * np.pi), rel=0.05)


@pytest.mark.renders
def test_ids_of_the_file_and_objects_of_the_scene_do_not_mix(folder: Path) -> None:
    values = {"objects": [BALL | {"scored": False}], "mitsuba": {"file": "scene.xml", "unscored": ["lamp"]}}
    scene = scene_of(folder, CAMERA + ROOM.replace('"back"', '"object1"'), **values)
    _, truth = simgen.draw_photons(scene, GRID, budget=100, cfa=None)
    assert {truth.names[number] for number in truth.unscored} == {"ball", "lamp"}
    assert truth.names[int(truth.object_id[SIDE // 2, SIDE // 2])] == "ball"
    assert truth.names[int(truth.object_id[0, 0])] == "object1"
    with pytest.raises(InputError, match="both named 'back'"):
        simgen.render(scene_of(folder, CAMERA + ROOM, objects=[BALL | {"name": "back"}]), GRID)


@pytest.mark.renders
def test_size_and_place_are_those_that_are_asked_for(folder: Path) -> None:
    content = '<shape type="cube" id="box"><transform name="to_world"><scale x="2"/></transform></shape>'
    # Recipes have integrators and films: those of a file need not work here.
    content += '<integrator type="stokes"><integrator type="elsewhere"/></integrator><film type="elsewhere"/>'
    place = {"file": "scene.xml", "place_at_mm": [0.0, 0.0, 600.0], "fit_mm": 100.0}
    scene = scene_of(folder, content, mitsuba=place, lights=[{"type": "uniform", "luminance_cd_m2": 1.0}])
    grid = CameraGrid(rows=1, cols=1, pitch_mm=(1, 1), focal_mm=50, pixel_mm=50 / 575, height=121, width=121)
    _, truth = simgen.draw_photons(scene, grid, budget=100, cfa=None)
    # The face that the camera sees is 100 mm wide and 50 mm high, 575 mm away: a pixel sees a millimetre.
    assert truth.z_mm[60, 60] == pytest.approx(575)
    assert (truth.object_id[60].sum(), truth.object_id[:, 60].sum()) == (pytest.approx(100, abs=1), 51)


@pytest.mark.parametrize(
    ("head", "content", "encoding", "sentence"),
    [
        ("", '<path value="plugins"/>', "ascii", "<path> is not followed"),
        ("", '<bsdf type="../../evil"/>', "ascii", "outside the scene's folder"),
        ("", DEFAULT + OBJ % "$d$d/secret.obj", "ascii", "outside the scene's folder"),
        ("", OBJ % "linked.obj", "ascii", "lies outside the folder"),
        ("", '<include filename="scene.xml"/><include filename="scene.xml"/>', "ascii", "deep"),
        ("", "<bsdf type='twosided'>" * 100 + "</bsdf>" * 100, "ascii", "100 deep"),
        ("", "<broken", "ascii", "not valid XML"),
        ('<!DOCTYPE scene [<!ENTITY a "b">]>', "", "ascii", "no DOCTYPE"),
        ('<?xml version="1.0" encoding="UTF-7"?>', "", "ascii", "encoding 'UTF-7'"),
        ("", "", "utf-16", "UTF-8"),
        ("<!--\u00e4-->", "", "utf-8-sig", ""),
    ],
)
def test_files_that_lead_outside_or_that_parsers_read_in_two_ways_are_refused(
    tmp_path: Path, head: str, content: str, encoding: str, sentence: str
) -> None:
    """Mitsuba loads and runs whatever library a plugin's type or a <path> names."""
    (tmp_path / "secret.obj").write_text("v 0 0 0")
    folder = tmp_path / "scene"
    folder.mkdir()
    (folder / "linked.obj").symlink_to(tmp_path / "secret.obj")
    (folder / "scene.xml").write_text(f'{head}<scene version="3.0.0">{content}</scene>', encoding)
    with pytest.raises(InputError, match=sentence) if sentence else contextlib.nullcontext():
        simgen.load_scene({"title": "x", "mitsuba": "scene.xml"}, folder=folder)


@pytest.mark.renders
def test_names_of_files_are_looked_up_as_mitsuba_does_but_never_in_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An included file is first looked for beside the file that includes it, a mesh beside the first file."""
    folder, elsewhere = tmp_path / "scene", tmp_path / "elsewhere"
    light = '<emitter type="point"><spectrum name="intensity" filename="%s"/></emitter>'
    written = {
        "scene.xml": CAMERA + light % "s.spd" + '<include filename="part/a.xml"/>',
        "part/a.xml": '<include filename="b.xml"/>',
        "part/b.xml": OBJ % "m.obj" + light % "d.spd",
        "b.xml": '<shape type="sphere" id="wrong"/>',
    }
    for name, content in written.items():
        written[name] = f'<scene version="3.0.0">{content}</scene>'
    written |= dict.fromkeys(["s.spd", "part/d.spd"], "400 1\n700 1\n") | {"part/m.obj": "not this one"}
    written["m.obj"] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3"
    for name, content in written.items():
        for place, text in ((folder, content), (elsewhere, "not this one")):
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (place / name).write_text(text)
    monkeypatch.chdir(elsewhere)
    assert reference_to(backend.load(), MitsubaFile(file="scene.xml"), folder).names == ("m",)
    imported = simgen.import_scene(folder / "scene.xml", tmp_path / "copy")
    assert imported.files == ("scene.xml", "s.spd", "part/a.xml", "part/b.xml", "m.obj", "part/d.spd")


@pytest.mark.renders
def test_what_mitsuba_refuses_is_one_sentence(tmp_path: Path) -> None:
    wrong = '<shape type="sphere"><float name="radios" value="1"/></shape>'
    for content, sentence in (
        (CAMERA + wrong, "radios"),
        (CAMERA + '<shape type="spher"/>', "'spher' is none of Mitsuba's plugins"),
        (CAMERA + SURFACE % ("conductor", '<string name="material" value="Xx"/>'), "'Xx' is none"),
        # These end the process otherwise.
        (CAMERA + SURFACE % ("blendbsdf", ""), "a blendbsdf needs a weight"),
        (CAMERA + SURFACE % ("diffuse", PICTURE), "a bitmap needs a filename"),
        ("<shape/>", "cannot read"),
        (ROOM, "it has 0 sensors; give mitsuba.camera"),
    ):
        with pytest.raises(InputError, match=sentence):
            simgen.render(scene_of(tmp_path, content), GRID, samples_per_pixel=1)


@pytest.mark.renders
def test_an_import_copies_what_the_file_names(folder: Path) -> None:
    scene_of(folder, CAMERA + ROOM + GLOSSY)
    place: dict[str, Any] = {"unit": "mm", "fit_mm": 200.0}
    with pytest.raises(InputError, match="no object 'table'; it has floor, back, lamp, ball, one, two"):
        simgen.import_scene(folder / "scene.xml", folder / "copy", unscored=["table"], **place)
    imported = simgen.import_scene(folder / "scene.xml", folder / "copy", unscored=["floor", "back"], **place)
    assert imported.files == ("scene.xml", "picture.png")
    assert imported.left_out[0].startswith("sensor perspective (fov = 35.0), film hdrfilm (width = 48, ")
    assert imported.left_out[0].endswith("of a sensor place and medium are used")
    placed = simgen.import_scene(folder / "scene.xml", folder / "placed", place_at_mm=(0.0, 0.0, 600.0))
    assert placed.left_out[0].endswith("nothing is used, not even its medium, since the scene is placed")
    scene: Any = simgen.load_scene(folder / "copy")
    assert (scene.mitsuba.unit_mm, scene.mitsuba.fit_mm) == (1.0, 200.0)
    assert scene.mitsuba.unscored == ("floor", "back")


@pytest.mark.renders
def test_a_sensor_that_mirrors_its_picture_is_named(folder: Path) -> None:
    mirroring = CAMERA.replace("<lookat", '<scale x="-1"/><lookat')
    scene_of(folder, mirroring + ROOM)
    with pytest.warns(UserWarning, match="the sensor 'front' mirrors its picture left to right"):
        mirrored = reference_to(backend.load(), MitsubaFile(file="scene.xml"), folder)
    scene_of(folder, CAMERA + ROOM)
    straight = reference_to(backend.load(), MitsubaFile(file="scene.xml"), folder)
    points_mm = np.eye(3)
    np.testing.assert_allclose(mirrored.frame.points(points_mm), straight.frame.points(points_mm), atol=1e-5)


@pytest.fixture
def libraries(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The only folder with libraries, at first none, of a machine without CUDA."""
    folder = tmp_path / "lib"
    folder.mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for name in ("SIMGEN_BACKEND", "DRJIT_LIBLLVM_PATH", "LD_LIBRARY_PATH"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(backend, "cuda_driver", lambda: None)
    monkeypatch.setattr(backend, "LIBRARY_FOLDERS", (str(folder.relative_to("/")),))
    return folder


@pytest.fixture
def trials(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the libraries that were tried: 19 works, others end the trial process."""
    names: list[str] = []

    def probe(kind: str, library: str) -> dict[str, bool | str]:
        names.append(Path(library).name)
        works = ".so.19" in library
        return {"works": works, "detail": "works" if works else "ended with signal 6"}

    monkeypatch.setattr(backend, "_probe", probe)
    return names


def test_the_newest_that_works_is_chosen_and_without_any_it_is_scalar(
    libraries: Path, trials: list[str]
) -> None:
    assert backend.choose().kind == "scalar"
    assert "libllvm19" in (backend.advice() or "")
    names = ("libLLVM-15.so.1", "libLLVM.so.20.1", "libLLVM.so.19.1", "libLLVM-9.so", "libLLVMCore.so.21")
    for name in names:
        (libraries / name).touch()
    (libraries / "libLLVM-20.so").symlink_to("libLLVM.so.20.1")
    choice = backend.choose()
    assert (choice.kind, choice.library) == ("llvm", str(libraries / "libLLVM.so.19.1"))
    assert trials == ["libLLVM.so.20.1", "libLLVM.so.19.1"]
    assert backend.advice() is None
    works = [(each.kind, each.works) for each in backend.survey()]
    assert works == [*(("llvm", number == 1) for number in range(4)), ("scalar", True)]
    assert backend.survey()[0].detail == "LLVM 20 ended with signal 6"


def test_answers_are_cached_until_the_library_changes(
    libraries: Path, trials: list[str], tmp_path: Path
) -> None:
    library = libraries / "libLLVM.so.19.1"
    library.write_bytes(b"one")
    backend.choose()
    backend.choose()
    assert len(trials) == 1
    (stored,) = (tmp_path / "cache" / "simgen").glob("*.json")
    assert json.loads(stored.read_text())["works"] is True
    stored.write_text("{")  # a damaged cache is ignored
    assert backend.choose().kind == "llvm"
    assert len(trials) == 2
    library.write_bytes(b"another")
    backend.choose()
    assert len(trials) == 3


def test_a_request_is_met_or_refused(libraries: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SIMGEN_BACKEND", "scalar")
    assert backend.choose().variant == "scalar_rgb"
    for request, sentence in (("llvm", "llvm does not work here"), ("opencl", "use one of cuda, llvm,")):
        monkeypatch.setenv("SIMGEN_BACKEND", request)
        with pytest.raises(InputError, match=sentence):
            backend.choose()


def test_a_library_that_kills_its_process_does_not_kill_ours(
    libraries: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (libraries / "libLLVM.so.19.1").touch()
    monkeypatch.setattr(backend, "_PROBE", "import os; os.abort()")
    assert backend.survey()[0].detail == "LLVM 19 ended the trial process with signal 6"
    (libraries / "libLLVM.so.20.1").touch()
    monkeypatch.setattr(backend, "_PROBE", "raise ImportError('no such library')")
    assert backend.survey()[0].detail == "LLVM 20 failed: ImportError: no such library"


@pytest.mark.renders
def test_nothing_is_loaded_from_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mi = backend.load()
    package = Path(mi.__file__).parent
    assert [Path(str(folder)) for folder in mi.file_resolver()] == [package]
    (tmp_path / "plugins").mkdir()
    for plugin in (package / "plugins").iterdir():
        (tmp_path / "plugins" / plugin.name).write_text("no library")
    (tmp_path / "numpy.py").write_text("raise ImportError")
    monkeypatch.chdir(tmp_path)
    assert backend._probe("scalar", "") == {"works": True, "detail": "works"}


@pytest.mark.parametrize("command", ["doctor", "generate small -o out"])
def test_without_mitsuba_one_sentence_says_what_to_install(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    find: Callable[..., object] = importlib.util.find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "mitsuba" else find(name))
    monkeypatch.chdir(tmp_path)
    assert run_simgen(*command.split()) == 2
    sentence = "error: mitsuba: not installed, and needed for rendering; type in the source tree:  "
    assert capsys.readouterr().err == sentence + "pip install '.[render]'\n"

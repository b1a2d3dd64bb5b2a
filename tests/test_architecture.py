"""The import rules of the design, kept by reading the source, and packages where they are installed."""

import ast
import re
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
HEAVY = {"mitsuba", "drjit", "colour"}
# Each room leans only on those before it.
ROOMS = {
    "pcii": [
        *("base", "figures", "types", "store", "sections", "exchange", "evidence", "depth"),
        *("removal", "metrics", "evaluation", "app"),
    ],
    "simgen": [
        *("base", "spectral", "spec", "drawn", "assets", "cameras", "renderer", "importing"),
        *("sensor", "truth", "photons", "dataset", "check", "app"),
    ],
}
# What simgen may share with pcii: store of files, types, masks, file formats and how commands
# behave. Not its geometry or anything built on it, so that simulation and reconstruction cannot share a sign
# mistake. Figures make pictures of plain arrays: they know no camera, and stand before the types.
SHARED_ROOMS = {"base", "store", "figures", "types", "exchange"}
NOT_SHARED = {"pcii.types.estimates", "pcii.types.focal_planes", "pcii.evidence.camera_fit"}
OUTSIDE = "tests", "benchmarks", "docs", "examples", "packaging", "scenes", "training"
MOST_FILES, FEWEST_FILES = 14, 2
LONGEST_FILE = 400
# Where a whole recipe is known, beside the commands: everything else takes parts of it.
KNOW_RECIPE = {
    "simgen.dataset.benchmark_making",
    "simgen.dataset.dataset_collection",
    "simgen.check.targets",
    "simgen.dataset.generation",
    "simgen.dataset.prepared",
    "simgen.spec.recipe_files",
}


@cache
def modules(package: str) -> dict[str, ast.Module]:
    """Every module of a package by its dotted name; a package by its own."""
    found: dict[str, ast.Module] = {}
    for file in sorted((ROOT / package).rglob("*.py")):
        name = ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        found[name] = ast.parse(file.read_text())
    return found


def is_room(name: str) -> bool:
    return (ROOT / name.replace(".", "/")).is_dir()


def room_of(name: str) -> str:
    """The room that a module is in, or that a package is; "" for the package at the root."""
    parts = name.split(".")[1:]
    return ".".join(parts if is_room(name) else parts[:-1])


def imported(node: ast.AST) -> set[str]:
    """Dotted names that one statement imports; `from a import b` counts as a and a.b, and as the module of
    the room a that has b."""
    if isinstance(node, ast.Import):
        return {alias.name for alias in node.names}
    if isinstance(node, ast.ImportFrom) and node.module and not node.level:
        names = {alias.name for alias in node.names}
        homes = {(module, name) for module, name in public_names(node.module) if name in names}
        return {
            *(node.module, *(f"{node.module}.{name}" for name in names)),
            *(part for module, name in homes for part in (module, f"{module}.{name}")),
        }
    return set()


@cache
def all_imports(tree: ast.Module) -> set[str]:
    return set().union(*(imported(node) for node in ast.walk(tree)))


def checks_types_only(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def top_level_imports(tree: ast.Module) -> set[str]:
    return set().union(*(imported(node) for node in tree.body if not checks_types_only(node)))


def roots(names: set[str]) -> set[str]:
    return {name.split(".")[0] for name in names}


def test_pcii_never_imports_simgen_or_a_renderer() -> None:
    for name, tree in modules("pcii").items():
        assert not roots(all_imports(tree)) & {"simgen", *HEAVY}, name


def test_simgen_takes_from_pcii_only_what_is_no_physics() -> None:
    known = set(modules("pcii")) - {"pcii"}
    allowed = {name for name in known if room_of(name) in SHARED_ROOMS} - NOT_SHARED
    for name, tree in modules("simgen").items():
        taken = all_imports(tree) & known
        assert taken <= allowed, f"{name} imports {sorted(taken - allowed)}"


def test_what_simgen_shares_has_no_geometry_in_it() -> None:
    trees = modules("pcii")
    for name, tree in trees.items():
        if room_of(name) in SHARED_ROOMS and name not in NOT_SHARED:
            assert not all_imports(tree) & NOT_SHARED, name


def test_the_renderer_is_loaded_in_one_file_inside_functions() -> None:
    for name, tree in modules("simgen").items():
        assert not roots(top_level_imports(tree)) & HEAVY, name
        if name != "simgen.renderer.backend":
            assert not roots(all_imports(tree)) & {"mitsuba", "drjit"}, name


@pytest.mark.parametrize("package", ROOMS)
def test_rooms_lean_on_those_before_them(package: str) -> None:
    """Lazy imports count like others."""
    trees = modules(package)
    rank = {room: number for number, room in enumerate(ROOMS[package])}
    assert {room_of(name) for name in trees} == {"", *rank}
    for name, tree in trees.items():
        for other in all_imports(tree) & set(trees):
            here, there = room_of(name), room_of(other)
            if here and there != here:
                assert there, f"{name} imports the root"
                assert rank[there] < rank[here], f"{name} imports {other}"


def test_stages_take_the_parts_of_a_recipe_that_they_need() -> None:
    for name, tree in modules("simgen").items():
        if "simgen.spec.recipe.Recipe" in all_imports(tree):
            assert name in KNOW_RECIPE or room_of(name) == "app", name


@pytest.mark.parametrize("package", ROOMS)
def test_no_room_has_a_cycle(package: str) -> None:
    trees = modules(package)
    arrows = {
        name: {
            other for other in all_imports(tree) & set(trees) if other != name and other not in parents(name)
        }
        for name, tree in trees.items()
    }
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as fault:
        pytest.fail(f"cycle: {' -> '.join(fault.args[1])}")


def parents(name: str) -> set[str]:
    """The packages that a module is in: naming them in an import makes no arrow."""
    parts = name.split(".")
    return {".".join(parts[:end]) for end in range(1, len(parts))}


@pytest.mark.parametrize("package", ROOMS)
def test_rooms_are_neither_crowded_nor_empty_and_say_what_they_are_for(package: str) -> None:
    for room in ROOMS[package]:
        folder = ROOT / package / room.replace(".", "/")
        files = {file.stem for file in folder.glob("*.py")} - {"__init__"}
        assert len(files) <= MOST_FILES, room
        assert len(files) >= FEWEST_FILES, room
        assert ast.get_docstring(ast.parse((folder / "__init__.py").read_text())), room


def test_the_page_has_the_rooms_in_their_order() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text()
    for package, rooms in ROOMS.items():
        (part,) = re.findall(rf"^{package}/ .*\n((?:  .*\n)+)", text, re.MULTILINE)
        listed = [name for line in part.splitlines() for name in re.findall(r"\w+", line[2:18])]
        assert listed == rooms


@cache
def public_names(room: str) -> set[tuple[str, str]]:
    """Module and name of what the `__init__.pyi` of a room such as `pcii.types` hands out."""
    file = ROOT / room.replace(".", "/") / "__init__.pyi"
    nodes = ast.parse(file.read_text()).body if file.is_file() else []
    return {
        (".".join(filter(None, (room, node.module))), alias.name)
        for node in nodes
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def taken_names(tree: ast.Module) -> set[tuple[str, str]]:
    """Module and name of what a file imports by name from this project's packages."""
    nodes = (node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and not node.level)
    taken = {(str(node.module), alias.name) for node in nodes for alias in node.names}
    return {(module, name) for module, name in taken if module.split(".")[0] in ROOMS}


def room_with_package(module: str) -> str:
    return ".".join(filter(None, (module.split(".")[0], room_of(module))))


@pytest.mark.parametrize("package", ROOMS)
def test_what_other_rooms_use_is_public(package: str) -> None:
    """They take it from the room, not from a module in it."""
    for name, tree in modules(package).items():
        for module, taken in taken_names(tree):
            if room_with_package(name) != room_with_package(module) and not is_room(f"{module}.{taken}"):
                assert taken in {public for _, public in public_names(module)}, f"{name}: {module}.{taken}"


def test_what_rooms_hand_out_has_users() -> None:
    """In another room, in the tests, or beside the packages."""
    outside = [file for folder in OUTSIDE for file in (ROOT / folder).rglob("*.py")]
    trees = {file.relative_to(ROOT).as_posix(): ast.parse(file.read_text()) for file in outside}
    taken = {(name, one) for name, tree in trees.items() for one in taken_names(tree)}
    for package in ROOMS:
        taken |= {
            (room_with_package(name), one)
            for name, tree in modules(package).items()
            for one in taken_names(tree)
        }
    for package, rooms in ROOMS.items():
        for room in (f"{package}.{room}" for room in rooms):
            for module, name in public_names(room):
                users = {user for user, one in taken if one in ((module, name), (room, name))} - {room}
                assert users or (module, name) in public_names(package), f"{module}.{name}"


def test_tests_use_what_is_public() -> None:
    """But for what a file lists, which only becomes shorter."""
    reaching = {
        f"{module} {name}"
        for file in (ROOT / "tests").rglob("*.py")
        for module, name in taken_names(ast.parse(file.read_text()))
        if name not in {public for _, public in public_names(module)} and not is_room(f"{module}.{name}")
    }
    listed = (ROOT / "tests" / "reaching_inside.txt").read_text().splitlines()
    assert sorted(reaching) == listed


def test_files_are_short() -> None:
    for package in ROOMS:
        for name in modules(package):
            file = ROOT / f"{name.replace('.', '/')}.py"
            if file.is_file():
                assert len(file.read_text().splitlines()) <= LONGEST_FILE, name


def test_tests_and_scripts_that_sentences_name_are_there() -> None:
    for file in [
        *ROOT.glob("*.md"),
        *ROOT.glob("docs/*.md"),
        *ROOT.glob("pcii/**/*.py"),
        *ROOT.glob("simgen/**/*.py"),
    ]:
        for name in re.findall(
            r"\b(?:tests|benchmarks|packaging|training|examples)/[\w/]+\.py\b", file.read_text()
        ):
            assert (ROOT / name).is_file(), f"{file.name}: {name}"


def test_no_module_shares_its_name_with_a_function() -> None:
    """But for commands: they have the names that users type."""
    for package in ROOMS:
        trees = modules(package)
        trees = {name: tree for name, tree in trees.items() if not name.endswith("commands")}
        leaves = {name.split(".")[-1] for name in trees}
        for name, tree in trees.items():
            functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
            assert not functions & leaves, f"{name}: {sorted(functions & leaves)}"


def test_importing_pcii_and_simgen_loads_no_renderer_and_no_compiler() -> None:
    script = (
        "import sys, pcii, numpy as np;"
        "grid = pcii.CameraGrid(rows=1, cols=2, pitch_mm=(1, 1), focal_mm=1, pixel_mm=1, height=2, width=2);"
        "repr(pcii.PhotonCounts.from_dense(np.ones(grid.shape_KLHW, int), grid));"
        "heavy = {'mitsuba', 'drjit', 'colour', 'numba', 'pydantic', 'zarr', 'simgen'};"
        "drawing = {'matplotlib', 'PIL', 'pandas'};"  # loaded by the first picture
        "print(*(heavy | drawing) & {*sys.modules});"
        "import simgen;"
        "print(*{'mitsuba', 'drjit', 'pydantic'} & {*sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_pcii_offers_the_names_that_users_rely_on() -> None:
    import pcii

    nouns = "CameraGrid Views PhotonCounts Sections Segmented DepthMap Truth Score Dataset InputError"
    verbs = "reconstruct demosaic segment estimate_depth score open_dataset removal_methods"
    for name in (nouns + " " + verbs).split():
        assert callable(getattr(pcii, name)), name
        assert name in pcii.__all__


@pytest.mark.slow
@pytest.mark.renders
def test_the_packages_work_in_a_clean_environment(tmp_path: Path) -> None:
    script = ROOT / "packaging" / "check_packages.py"
    done = subprocess.run(
        [sys.executable, str(script), str(tmp_path / "trial")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "analysis installs" in done.stdout

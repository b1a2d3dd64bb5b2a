"""The import rules of the design, kept by reading the source."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
HEAVY = {"mitsuba", "drjit", "colour"}
# What simgen may share with pcii: nouns, masks, the file format and how commands behave. Not its
# geometry or anything built on it, so that simulation and reconstruction cannot share a sign mistake.
SHARED = {
    "pcii",
    "pcii.types",
    "pcii.photon_counts",
    "pcii.bayer",
    "pcii.errors",
    "pcii.store",
    "pcii.safe_files",
    "pcii.sealed",
    "pcii.zarr_groups",
    "pcii.dataset",
    "pcii.verify",
    "pcii.console",
}
# Arrows run from the top of this list to the bottom, never back; what is on one line is one level.
PCII_LEVELS = [
    {"errors", "plain", "timing"},
    {"brief", "pages"},
    {"bayer", "cells", "safe_files", "console", "paired", "evaluation_tables", "evaluation_plots"},
    {"sealed", "kernels"},
    {"zarr_groups", "results_list"},
    {
        "types",
        "dense_kernels",
        "demosaic_kernels",
        "prediction_kernels",
        "label_kernels",
        "outline_kernels",
    },
    {"photon_counts", "store", "manifest_schema", "focus_kernels", "layer_kernels"},
    {"stored_radiance"},
    {"geometry", "dataset", "verify", "demosaic", "picture", "hot_pixels"},
    {"dense", "boundary"},
    {"reconstruct", "planes", "foreground", "pieces"},
    {"statistics", "edge_entropy"},
    {"focus", "outline", "halves"},
    {"regions", "layers"},
    {"guesses"},
    {"layer_search"},
    {"duel"},
    {"likelihood"},
    {"three_step", "depth", "true_masks", "plugins"},
    {"baselines", "agreement", "oracle", "depth_score"},
    {"segment", "score"},
    {"results", "measurements"},
    {"pipeline", "summary"},
    {"report", "evaluation_report"},
    {"run", "evaluate"},
    {"cli"},
]
SIMGEN_LEVELS = [
    {"locations", "seeds", "srgb"},
    {"backend", "schema", "asset_names", "triangles"},
    {"textures", "areas", "spectra"},
    {"shapes", "materials", "lights", "camera_grid"},
    {"solids", "read_ply", "read_obj", "read_image", "paint"},
    {"recipe", "scene", "filters", "asset_worker"},
    {"assets"},
    {"cameras", "shifts", "figures", "thumbnails", "build_shape", "build_colour"},
    {"build_surface", "build_light"},
    {"build", "detector", "exposure", "sensor"},
    {"wavelengths", "prepared"},
    {"targets"},
    {"majorant", "paths", "render", "truth", "rays"},
    {"candidates", "coverage", "visibility"},
    {"lanes", "singles"},
    {"pools"},
    {"pilot"},
    {"photons", "noise"},
    {"counts", "truth_file", "unseen"},
    {"facts", "resources"},
    {"generate", "probe_scene", "check_sight", "check_depth", "check_photons", "check_cost"},
    {"check", "preview", "sheet", "series"},
    {"cli"},
]


def modules(package: str) -> dict[str, ast.Module]:
    return {file.stem: ast.parse(file.read_text()) for file in sorted((ROOT / package).glob("*.py"))}


def imported(node: ast.AST) -> set[str]:
    """Dotted names that one statement imports; `from a import b` counts as a and a.b."""
    if isinstance(node, ast.Import):
        return {alias.name for alias in node.names}
    if isinstance(node, ast.ImportFrom) and node.module and not node.level:
        return {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return set()


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
    known = {f"pcii.{name}" for name in modules("pcii")}
    for name, tree in modules("simgen").items():
        taken = all_imports(tree) & (known | {"pcii"})
        assert taken <= SHARED, f"simgen.{name} imports {sorted(taken - SHARED)}"


def test_the_renderer_is_loaded_in_one_file_inside_functions() -> None:
    for name, tree in modules("simgen").items():
        assert not roots(top_level_imports(tree)) & HEAVY, name
        if name != "backend":
            assert not roots(all_imports(tree)) & {"mitsuba", "drjit"}, name


@pytest.mark.parametrize(("package", "levels"), [("pcii", PCII_LEVELS), ("simgen", SIMGEN_LEVELS)])
def test_arrows_run_one_way(package: str, levels: list[set[str]]) -> None:
    rank = {name: number for number, level in enumerate(levels) for name in level}
    trees = modules(package)
    trees.pop("__init__")
    assert set(trees) == set(rank), "a module has no level, or a level no module"
    for name, tree in trees.items():
        used = {part for part in trees if f"{package}.{part}" in top_level_imports(tree)}
        for other in used:
            assert rank[other] < rank[name], f"{package}.{name} imports {package}.{other}"


def test_pages_are_made_in_one_file() -> None:
    for package in ("pcii", "simgen"):
        for name, tree in modules(package).items():
            assert name == "pages" or not roots(all_imports(tree)) & {"jinja2", "markupsafe"}, name


def test_importing_pcii_is_light() -> None:
    script = (
        "import sys, time; start = time.perf_counter(); import pcii;"
        "spent = time.perf_counter() - start;"
        "print(spent, *[m for m in ('mitsuba', 'drjit', 'colour', 'numba', 'simgen') if m in sys.modules])"
    )
    best = min(
        (subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout)
        for _ in range(3)
    )
    seconds, *loaded = best.split()
    assert loaded == []
    assert float(seconds) < 0.5


def test_pcii_offers_the_names_that_users_rely_on() -> None:
    import pcii

    nouns = "CameraGrid Views PhotonCounts Sections Segmented DepthMap Truth Score Dataset InputError"
    verbs = "reconstruct reconstruct_each demosaic segment estimate_depth score open_dataset removal_methods"
    for name in (nouns + " " + verbs).split():
        assert callable(getattr(pcii, name)), name
        assert name in pcii.__all__

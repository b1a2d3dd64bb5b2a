"""The `simgen` command."""

import json
import math
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import App, Parameter

from pcii.base import command_line
from pcii.base.command_line import say
from pcii.base.progress import Stages

app = App(
    name="simgen",
    help="Make photon-limited elemental images from physics, with their truth.",
    version=lambda: version("photon-integral-imaging"),
)


@app.command
def doctor(*, require_compiled: bool = False) -> None:
    """Say which backend will run and why, and what to install for a faster one.

    Example:  simgen doctor

    Parameters
    ----------
    require_compiled
        Leave with exit code 1 if neither CUDA nor LLVM works (for scripts that install LLVM).
    """
    from simgen.renderer import backend

    chosen = backend.choose()
    say(f"Rendering will run with {chosen.line()}")
    for candidate in backend.survey():
        mark = "works" if candidate.works else "no"
        say(f"  {mark:5}  {candidate.kind:6}  {candidate.library or '-'}: {candidate.detail}")
    hint = backend.advice()
    if hint:
        say(hint)
    if require_compiled and chosen.kind == "scalar":
        raise RuntimeError("no compiled backend works here")


@app.command
def scenes() -> None:
    """List the scenes that ship or stand in the working directory's `scenes/`, one line each.

    Example:  simgen scenes
    """
    from simgen.spec.scene import load_scene, scene_names

    for name in scene_names():
        scene, _ = load_scene(name)
        things = ", ".join(thing.name for thing in scene.objects) or "no objects"
        say(f"{name:20} {scene.title} ({things})")


@app.command
def schema(what: Literal["scene", "recipe"]) -> None:
    """Print the JSON Schema of scene or recipe files, for completion in editors.

    Example:  simgen schema recipe > recipe.schema.json
    """
    from simgen.base.strict_models import schema_of
    from simgen.spec.recipe import Recipe
    from simgen.spec.scene import Scene

    model = {"scene": Scene, "recipe": Recipe}[what]
    json.dump(schema_of(model), sys.stdout, indent=2)
    say("")


@app.command
def check(
    target: str,
    *,
    set: Annotated[tuple[str, ...], Parameter(name="--set")] = (),
    json_: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> int:
    """Validate and lint a scene or recipe without rendering: one line a finding, in seconds.

    Disparities, blur between objects, what is hidden or cut, colours that shifts leave out, photons per
    object and voxel, size, memory and time. Leaves with exit code 0 if nothing is bad, 1 if something
    is, 2 for a file that is not valid.

    Examples:

        simgen check two_objects

        simgen check paper --set grid.pitch_mm=[2.5,2.5]

    Parameters
    ----------
    target
        A recipe, or a scene, which is looked at with the paper's camera grid; by name or path.
    set
        Override one value of the recipe, such as photons.budget=300; may be repeated.
    json_
        Print the findings as JSON.
    """
    from dataclasses import asdict

    from simgen.check.linter import lint

    line, findings = lint(target, set)
    bad = sum(finding.verdict == "bad" for finding in findings)
    if json_:
        say(json.dumps([asdict(finding) for finding in findings], indent=2))
    else:
        warnings = sum(finding.verdict == "warn" for finding in findings)
        say(line)
        for finding in findings:
            say(finding.line())
        say(f"{bad} bad, {warnings} to be warned of, {len(findings)} findings in all")
    return 1 if bad else 0


@app.command
def preview(
    target: str,
    *,
    out: Annotated[Path, Parameter(name=("--out", "-o"))],
    set: Annotated[tuple[str, ...], Parameter(name="--set")] = (),
    samples_per_pixel: int = 32,
) -> None:
    """Draw a scene or recipe from the virtual centre, with its depth and its objects, in one picture.

    In full light and in sRGB, whatever the recipe's camera and photons.

    Example:  simgen preview two_objects -o look.png

    Parameters
    ----------
    target
        A recipe, or a scene, which is looked at with the paper's field of view; by name or path.
    out
        The picture to write, .png or .jpg, in a folder that exists.
    set
        Override one value of the recipe, such as grid.pixel_mm=0.02; may be repeated.
    samples_per_pixel
        Light paths per pixel; more is slower and less noisy.
    """
    from simgen.figures.preview_picture import write_preview

    write_preview(target, out, samples_per_pixel, overrides=set)
    say(f"{out}")


@app.command
def generate(
    recipe: str,
    *,
    out: Annotated[Path, Parameter(name=("--out", "-o"))],
    set: Annotated[tuple[str, ...], Parameter(name="--set")] = (),
    seeds: Annotated[int | None, Parameter(converter=command_line.whole)] = None,
) -> None:
    """Make the dataset of a recipe; run again to resume.

    Examples:

        simgen generate data_recipes/paper.toml -o out/paper

        simgen generate paper -o out/dim --set photons.budget=100 --set seed=3

        simgen generate paper -o out/twenty --seeds 20 --set products.radiance=none

    Parameters
    ----------
    recipe
        Path of a recipe file, or name of one that ships.
    out
        Folder for the dataset: new, empty, or the same recipe's unfinished one.
    set
        Override one value of the recipe, such as photons.budget=300; may be repeated.
    seeds
        Make so many datasets, in folders seed_7, seed_8, ... of OUT: of the recipe's seed and those that
        follow. Each is whole; radiance is rendered for each, so leave it out where nothing needs it.
    """
    from simgen.dataset.generation import generate as make
    from simgen.dataset.series import generate_series
    from simgen.renderer import backend
    from simgen.spec.recipe import load_recipe

    resolved, near = load_recipe(recipe, set)
    say(f"backend: {backend.choose().line()}")
    with Stages() as report:
        if seeds is None:
            say(_made(out, make(resolved, near, out, report)))
            return
        for done, (folder, manifest) in enumerate(generate_series(resolved, near, out, seeds), start=1):
            say(_made(folder, manifest))
            report("datasets", done, seeds)


def _made(folder: Path, manifest: dict[str, Any]) -> str:
    """One line about a finished dataset."""
    seconds = sum(manifest["timings_s"].values())
    photons = manifest["photons"]
    caught = f", {photons['total']} photons" if photons else ""
    line = f"{folder}: {len(manifest['files'])} files{caught}, made in {seconds:.1f} s"
    if photons and photons.get("clump_pairs", 0) > photons.get("clump_pairs_allowed", math.inf):
        line += (
            f"\n{photons['clump_pairs']} pairs of photons came of one path each, where at most "
            f"{photons['clump_pairs_allowed']:g}: a test of the counts might tell them from Poisson ones"
        )
    return line


@app.command
def sheet(dataset: Path, *, out: Annotated[Path, Parameter(name=("--out", "-o"))]) -> None:
    """Draw a contact sheet of a finished dataset: truth, photons of all views, full light, facts.

    Example:  simgen sheet out/paper -o paper.png

    Parameters
    ----------
    dataset
        Folder of the dataset.
    out
        The picture to write, .png or .jpg, in a folder that exists.
    """
    from simgen.figures.contact_sheet import write_sheet

    write_sheet(dataset, out)
    say(f"{out}")


@app.command
def verify(dataset: Path) -> None:
    """Compare every file of a dataset, or of a folder of results, with its manifest.

    Names what is missing, truncated or changed, and what the manifest does not list.

    Example:  simgen verify out/paper
    """
    from pcii.io.verification import verify as compare

    with Stages() as report:
        count = compare(dataset, report)
    say(f"{dataset}: {count} files match the manifest")


def main() -> int:
    """Entry point of the `simgen` command."""
    return command_line.run(app, resuming=("generate",))

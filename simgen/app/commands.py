"""The `simgen` command."""

from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from pcii.base import command_line
from pcii.base.command_output import answer, answer_json, complain_of, results_folder, say, say_next
from pcii.base.executor import ALONE, Executor
from pcii.base.progress import Stages
from simgen.app.authoring_commands import import_scene, new_recipe, new_scene
from simgen.app.benchmark_commands import benchmark
from simgen.app.scene_commands import Json, Out, Overrides, check, preview, recipes, scenes, schema

app = command_line.command_app(
    "simgen", "Make photon-limited elemental images from physics, with their truth."
)

for command in (
    scenes,
    recipes,
    schema,
    check,
    preview,
    new_scene,
    new_recipe,
    import_scene,
    benchmark,
):
    app.command(command)


@app.command
def doctor(*, require_compiled: bool = False, json: Json = False) -> None:
    """Say which backend will run and why, and what to install for a faster one.

    Examples of use:

        simgen doctor
        simgen doctor --json

    Parameters
    ----------
    require_compiled
        Leave with exit code 1 if neither CUDA nor LLVM works (for scripts that install LLVM).
    json
        Print the same as JSON.
    """
    from dataclasses import asdict

    from simgen.renderer import backend

    chosen, candidates, advice = backend.choose(), backend.survey(), backend.advice()
    if json:
        found = [asdict(candidate) for candidate in candidates]
        answer_json({"chosen": asdict(chosen), "candidates": found, "advice": advice})
    else:
        answer(f"Rendering will run with {chosen.line()}")
        for candidate in candidates:
            mark = "works" if candidate.works else "no"
            answer(f"  {mark:5}  {candidate.kind:6}  {candidate.library or '-'}: {candidate.detail}")
        if advice:
            answer(advice)
        say_next("simgen", "scenes")
    if require_compiled and chosen.kind == "scalar":
        raise RuntimeError("no compiled backend works here")


@app.command
def generate(
    recipe: str,
    *,
    out: Out,
    set: Overrides = (),
    seeds: int | None = None,
    scenes: int | None = None,
    trust_python: bool = False,
    executor: Annotated[Executor, Parameter(name="*")] = ALONE,
) -> int:
    """Make the dataset of a recipe, a collection where fields have several values; run again to resume.

    A field that takes one value may have a list, any field { each = [...] } or { range = [first, end] }:
    OUT then has a folder for each combination, and an index of them.

    Examples of use:

        simgen generate data_recipes/paper.toml -o out/paper
        simgen generate paper -o out/dim --set photons.budget=100 --set seed=3
        simgen generate paper -o out/twenty --seeds 20 --set products.radiance=none
        simgen generate paper -o out/dimmer --set photons.budget=[100,300,1000] --seeds 5 --workers 2
        simgen generate drawn_crossing -o out/crossings --scenes 1000

    Parameters
    ----------
    recipe
        Path of a recipe file, or name of one that ships; or a scene, seen by the paper's cameras.
    out
        Folder for the dataset or collection: new, empty, or an unfinished one of the same recipe.
    set
        Override one value of the recipe, such as photons.budget=300; may be repeated.
    seeds
        Make so many datasets, of the recipe's seed and those that follow. Each is whole; radiance is rendered
        for each, so leave it out where nothing needs it.
    scenes
        Make datasets of this many drawn scenes, from the recipe's scene_number on.
    trust_python
        Run the Python function that a recipe file names as its scene: only if you trust its author.
    """
    from pcii.exporting.card_files import write_card
    from simgen.dataset.dataset_collection import generate_collection
    from simgen.dataset.generation import generate as make
    from simgen.renderer import backend
    from simgen.spec.sweeps import load_sweep

    sweep = load_sweep(recipe, set, seeds=seeds, scenes=scenes, trust_python=trust_python)
    terms = sweep.recipe(0).publication.terms()
    say(f"backend: {backend.choose().line()}")
    with Stages() as report:
        if not sweep.axes:
            manifest = make(sweep.recipe(0), sweep.recipe_folder, out, report)
            write_card(out, terms)
            say(_made(out, manifest))
            say_next("pcii", "run", out, "-o", results_folder(out))
            return 0
        if len(sweep) > 1 and sweep.recipe(0).products.radiance != "none":
            say(
                f"radiance is rendered for each of {len(sweep)} datasets, which may take most of the time; "
                "--set products.radiance=none leaves it out"
            )
        faults = generate_collection(sweep, out, executor, report)
        write_card(out, terms)
    say(f"{out}: {len(sweep) - len(faults)} of {len(sweep)} datasets are finished")
    if not faults:
        say_next("pcii", "evaluate", out, "-o", out.parent / f"{out.name}-compared")
        return 0
    complain_of(faults, "not made: ", " were not made")
    return 1


def _made(folder: Path, manifest: dict[str, Any]) -> str:
    """One line about a finished dataset."""
    seconds = sum(manifest["timings_s"].values())
    photons = manifest["photons"]
    caught = f", {photons['total']} photons" if photons else ""
    return f"{folder}: {len(manifest['files'])} files{caught}, made in {seconds:.1f} s"


@app.command
def sheet(dataset: Path, *, out: Out) -> None:
    """Draw a contact sheet of a finished dataset: truth, photons of all views, full light, facts.

    Example of use:

        simgen sheet out/paper -o paper.png

    Parameters
    ----------
    dataset
        Folder of the dataset.
    out
        The picture to write, .png or .jpg, in a folder that exists.
    """
    from simgen.app.contact_sheet import write_sheet

    write_sheet(dataset, out)
    say(f"{out}")
    say_next("pcii", "run", dataset, "-o", results_folder(dataset))


@app.command
def export(
    dataset: Path,
    *,
    format: Literal["hci", "nerfstudio", "photoncube", "events"],
    out: Out,
    budget: float | None = None,
) -> None:
    """Write a dataset in a format that other tools read: into a new folder, as a whole or not at all.

    hci: the layout of the HCI 4D light field benchmark. nerfstudio: a PNG for each view and transforms.json
    with the poses of the cameras, as neural reconstruction reads them. photoncube: the binary frames of each
    view as packed bits, with poses. events: a NumPy archive of photons, cameras and truth. Each dataset of a
    collection is written to a folder in the new one that has its name.

    Examples of use:

        simgen export out/paper --format events -o out/paper-events
        simgen export out/small --format hci -o out/hci/small
        simgen export out/small --format nerfstudio -o out/small-poses
        simgen export out/spad --format photoncube -o out/spad-cubes
        simgen export out/paper --format events --budget 300 -o out/paper-300
        simgen export out/sweep --format events -o out/sweep-events

    Parameters
    ----------
    dataset
        Folder of a dataset or of a collection.
    out
        Folder for the files: new or empty.
    budget
        Export the photons of this smaller, nested budget of the recipe.
    """
    from pcii.exchange.export_formats import export_dataset

    with Stages() as report:
        folder = export_dataset(dataset, format, out, budget=budget, report=report)
    files = [file for file in folder.rglob("*") if file.is_file()]
    say(f"{folder}: {len(files)} files, {sum(file.stat().st_size for file in files) / 1e6:.1f} MB")


@app.command
def verify(dataset: Path, *, json: Json = False) -> None:
    """Compare every file of a dataset, a collection, results or an evaluation with its manifest.

    Names what is missing, truncated or changed, and what the manifest does not list.

    Examples of use:

        simgen verify out/paper
        simgen verify out/paper --json

    Parameters
    ----------
    dataset
        Folder of a dataset, of a collection, of results or of an evaluation.
    json
        Print the number of files, or what is wrong, as JSON.
    """
    from pcii.io.verification import verify_and_tell

    verify_and_tell(dataset, as_json=json)


def main() -> int:
    """Entry point of the `simgen` command."""
    return command_line.run(app, resuming=("generate", "benchmark"))

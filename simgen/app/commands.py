"""The `simgen` command: datasets, and what they are made with."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from pcii.base import (
    THIS_PROCESS,
    Executor,
    Stages,
    answer_json,
    command_line,
    complain_of,
    results_folder,
    say,
    say_next,
)
from pcii.exchange import export
from pcii.store import Half
from simgen.app.scene_commands import SCENE_COMMANDS, Json, Out, Overrides, TrustPython

app = command_line.command_app(
    "simgen", "Make photon-limited elemental images from physics, with their truth."
)

for command in (*SCENE_COMMANDS, export):
    app.command(command)

benchmark = App(
    name="benchmark",
    help="""Make the public benchmark, and certify it.

    Example of use:

        simgen benchmark make -o out/pcii-bench-1
    """,
)
app.command(benchmark)


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
    """
    from dataclasses import asdict

    from simgen.renderer import backend

    chosen, candidates, advice = backend.choose(), backend.survey(), backend.advice()
    if json:
        survey = [asdict(candidate) for candidate in candidates]
        answer_json({"chosen": asdict(chosen), "candidates": survey, "advice": advice})
    else:
        say(f"Rendering will run with {chosen.line()}")
        for candidate in candidates:
            mark = "works" if candidate.works else "no"
            say(f"  {mark:5}  {candidate.kind:6}  {candidate.library or '-'}: {candidate.detail}")
        if advice:
            say(advice)
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
    trust_python: TrustPython = False,
    executor: Annotated[Executor, Parameter(name="*")] = THIS_PROCESS,
) -> int:
    """Make the dataset of a recipe, a collection where fields have several values; run again to resume.

    A field that takes one value may have a list, any field { each = [...] } or { range = [first, end] }:
    OUT then has a folder for each combination, and an index of them.

    Examples of use:

        simgen generate paper -o out/paper
        simgen generate paper -o out/paper-dim --set photons.budget=100 --set seed=3
        simgen generate paper -o out/dimmer --set photons.budget=[100,300,1000] --seeds 5 --workers 2
        simgen generate drawn_crossing -o out/crossings --scenes 1000

    Parameters
    ----------
    recipe
        Path of a recipe file, or name of one that ships; or a scene, seen by the paper's cameras.
    out
        Folder for the dataset or collection: new, empty, or an unfinished one of the same recipe.
    seeds
        Make this many datasets, of the recipe's seed and those that follow.
    scenes
        Make datasets of this many drawn scenes, from the recipe's scene_number on.
    """
    from simgen.app.library import generate as generate_dataset
    from simgen.app.library import generate_sweep
    from simgen.renderer import backend
    from simgen.spec import RecipeFile, load_sweep

    sweep = load_sweep(recipe, set, seeds=seeds, scenes=scenes, trust_python=trust_python)
    say(f"backend: {backend.choose().line()}")
    with Stages() as report:
        if not sweep.axes:
            manifest = generate_dataset(RecipeFile(sweep.recipe(0), sweep.recipe_folder), out, report)
            photons = f", {manifest['photons']['total']} photons" if manifest["photons"] else ""
            seconds = sum(manifest["timings_s"].values())
            say(f"{out}: {len(manifest['files'])} files{photons}, made in {seconds:.1f} s")
            say_next("pcii", "run", out, "-o", results_folder(out))
            return 0
        faults = generate_sweep(sweep, out, executor, report)
    say(f"{out}: {len(sweep) - len(faults)} of {len(sweep)} datasets are finished")
    if faults:
        complain_of(faults, "not made: ")
        return 1
    say_next("pcii", "evaluate", out, "-o", out.parent / f"{out.name}-compared")
    return 0


@benchmark.command
def make(
    name: str = "pcii-bench-1",
    *,
    out: Out,
    half: Half | None = None,
    scene: tuple[str, ...] = (),
    executor: Annotated[Executor, Parameter(name="*")] = THIS_PROCESS,
) -> int:
    """Make the datasets of a benchmark, and compare them with the published ones; run again to resume.

    OUT is a collection with a folder for each dataset, and certificate.json, which says whether they have the
    published bytes or, on another kind of machine, photons that are draws of the same light.

    Examples of use:

        simgen benchmark make -o out/pcii-bench-1
        simgen benchmark make -o out/pcii-bench-1 --half development --workers 2
        simgen benchmark make -o out/pcii-bench-1 --scene ball-and-bird --scene foliage

    Parameters
    ----------
    name
        The benchmark, one that ships or the path of its file.
    out
        Folder for the collection: new, empty, or one of the same benchmark.
    half
        Make the scenes of this half only; the others may follow.
    scene
        Make this scene only; may be repeated.
    """
    from pcii.store import CERTIFICATE
    from simgen.dataset import certify, load_definition, make_benchmark
    from simgen.renderer import backend

    definition, file = load_definition(name)
    say(f"backend: {backend.choose().line()}")
    with Stages() as report:
        faults = make_benchmark(
            definition, file, out, half=half, names=scene, executor=executor, report=report
        )
        if faults:
            complain_of(faults, "not made: ")
            return 1
        verdict = certify(definition, file, out, report)
    complain_of(verdict.problems)
    say(f"{out / CERTIFICATE}: {verdict.sentence()}")
    say_next("pcii", "benchmark", "run", "posterior", "--data", out, "-o", out.parent / "submission")
    return 1 if verdict.problems else 0


@app.command
def sheet(dataset: Path, *, out: Out) -> None:
    """Draw a contact sheet of a finished dataset: truth, photons of all views, full light, facts.

    Example of use:

        simgen sheet out/paper -o sheet.png

    Parameters
    ----------
    dataset
        Folder of the dataset.
    out
        The picture to write, .png or .jpg, in a folder that exists.
    """
    from simgen.app.pictures import write_sheet

    write_sheet(dataset, out)
    say(f"{out}")
    say_next("pcii", "run", dataset, "-o", results_folder(dataset))


@app.command
def verify(dataset: Path, *, json: Json = False) -> None:
    """Compare every file of a dataset, a collection, results or an evaluation with its manifest.

    Names what is missing, truncated or changed, and what the manifest does not list.

    Example of use:

        simgen verify out/paper

    Parameters
    ----------
    dataset
        Folder of a dataset, of a collection, of results or of an evaluation.
    """
    from pcii.store import print_verification

    print_verification(dataset, as_json=json)


def main() -> int:
    """Entry point of the `simgen` command."""
    return command_line.run(app, resuming=("generate", "benchmark"))

"""The `pcii` command."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pcii.app.benchmark_commands import benchmark
from pcii.app.command_options import Budget, Depths, Json, Out, opened
from pcii.app.import_commands import import_dataset
from pcii.app.results import Results
from pcii.app.step_commands import depth, reconstruct, segment
from pcii.base import command_line
from pcii.base.command_output import answer_json, results_folder, say, say_next, say_next_page
from pcii.base.executor import ALONE, Executor
from pcii.base.progress import Stages
from pcii.depth.methods import DEFAULT_METHOD

app = command_line.command_app(
    "pcii", "Reconstruct photon-counted integral images, remove defocused points, and score the result."
)

app.command(import_dataset, name="import")
for command in (reconstruct, depth, segment, benchmark):
    app.command(command)


@app.command
def sample(*, out: Out) -> None:
    """Copy the sample dataset that comes with the package: ball and bird, 5 x 5 views, 2000 photons in each.

    Example of use:

        pcii sample -o out/sample

    Parameters
    ----------
    out
        Folder for the dataset: new or empty.
    """
    from pcii.store.sample_dataset import copy_sample

    copy_sample(out)
    say(f"{out}")
    say_next("pcii", "run", out, "-o", results_folder(out))


@app.command
def run(
    dataset: Path,
    *,
    out: Out,
    z_mm: Depths = (),
    method: tuple[str, ...] = (),
    depth_method: str = DEFAULT_METHOD,
    budget: Budget = None,
    smoothing_px: float | None = None,
) -> None:
    """Analyse a dataset completely: sections, removal by each method, depth, scores, report.html.

    What earlier runs finished, interrupted ones too, is kept where dataset, options and software (with that
    of methods of other packages) are the same: the command goes on from there.

    Examples of use:

        pcii run out/paper -o out/paper-results
        pcii run out/paper -o out/stack --z-mm 500:700:20 --method likelihood
        pcii run out/paper -o out/paper-300 --budget 300

    Parameters
    ----------
    dataset
        A dataset folder, as made by `simgen generate`.
    out
        Folder for the results: new, empty, or that of earlier results of the same dataset.
    z_mm
        Depth of a section in mm, or start:stop:step; repeat for more. Default: the depths that the recipe
        names.
    method
        A method of removal, as in `pcii segment`; repeat for more. Default: three-step and likelihood.
    depth_method
        A method of depth, as in `pcii depth`.
    smoothing_px
        Standard deviation of the Gaussian with which the report shows photons of sections, in pixels; 0 for
        none. Default: the wider the fewer photons there are. Nothing else is smoothed.
    """
    from pcii.app.single_run import run as run_all

    with Stages() as report:
        outcome = run_all(
            opened(dataset, budget), out, z_mm, report, method or None, depth_method, smoothing_px
        )
    if outcome.kept:
        say(f"kept from an earlier run: {'; '.join(outcome.kept)}")
    for row in outcome.score.planes:
        if row["truth"] == "object" and row["object"] is not None and row["iou"] is not None:
            say(f"{row['z_mm']:g} mm, {row['method']}: IoU {row['iou']:.3f} ({row['object']})")
    if not outcome.focus:
        say("sections and depth only: removal needs photon counts; import the images with --photons N")
    say(f"report: {out / 'report.html'}")
    say_next_page(out / "report.html")


@app.command
def score(dataset: Path, out: Path, *, budget: Budget = None, json: Json = False) -> None:
    """Compare the results in a folder with the dataset's truth, and write score.json into it.

    Examples of use:

        pcii score out/paper out/paper-results
        pcii score out/paper out/depth --json

    Parameters
    ----------
    dataset
        The dataset folder, with truth.
    out
        The folder of results of `pcii run`, `pcii segment` or `pcii depth`.
    json
        Print the score too, as score.json has it.
    """
    from pcii.app.pipeline import full_light_sections
    from pcii.base.errors import InputError
    from pcii.metrics.scoring import score as compare
    from pcii.types.focal_planes import FocalPlanes

    data = opened(dataset, budget)
    results = Results(out, data)
    results.check()
    focus, depth_map = results.load_segmented(), results.load_depth()
    if not focus and depth_map is None:
        steps = "`pcii segment`, `pcii depth` or `pcii run`"
        raise InputError(f"{out}: has neither in-focus masks nor a depth map; make them with {steps}")
    z_mm = data.analysis.get("z_mm")
    planes = FocalPlanes.at_depths(data.grid, z_mm) if z_mm else None
    if focus:
        planes = focus[0].sections.planes
    full_light = None
    if data.truth is not None and planes is not None:
        with Stages() as report:
            full_light = full_light_sections(data, planes, report)
    result = compare(focus, depth_map, data.truth, grid=data.grid, full_light=full_light, dataset=data.name)
    with results.writing():
        path = results.save_score(result)
    if json:
        answer_json(result.to_dict())
    else:
        say(f"{path}")
        if data.truth is None:
            say("the dataset has no truth: what is compared with it is null")
            return
        say_next("pcii", "evaluate", dataset, "-o", out.parent / f"{dataset.name}-compared")


@app.command
def evaluate(
    datasets: tuple[Path, ...],
    *,
    out: Out,
    method: tuple[str, ...] = (),
    budget: tuple[str, ...] = (),
    z_mm: Depths = (),
    executor: Annotated[Executor, Parameter(name="*")] = ALONE,
) -> None:
    """Compare methods over datasets and photon budgets, with intervals over seeds; resumes when run again.

    Writes evaluation.html, evaluation.md and means.csv, and each score, as it is measured, to rows.jsonl.
    Scores that other software made are made again.

    Examples of use:

        pcii evaluate out/twenty -o out/compared
        pcii evaluate out/twenty out/slats -o out/compared --method depth:focus --budget 300 --workers 2

    Parameters
    ----------
    datasets
        Dataset folders, collections as `simgen generate` makes them, or folders of dataset folders.
    out
        Folder for the evaluation: new, empty, or that of an earlier evaluation, which is extended.
    method
        A method of removal, as in `pcii segment`, or depth:NAME, as in `pcii depth` ("depth": the default
        one); or module:function or file.py:function, with depth: before it for depth; may be repeated.
        Default: all that can take the data.
    budget
        A photon budget that every dataset has, or full-light: its radiance; may be repeated. Default: all.
    z_mm
        Depth of a section in mm, or start:stop:step; repeat for more. Default: the depths that each recipe
        names.
    """
    from pcii.evaluation.comparison import evaluate as compare

    with Stages() as report:
        evaluation = compare(
            datasets, out, methods=method, budgets=budget, z_mm=z_mm, executor=executor, report=report
        )
    if differing := ", ".join(evaluation.origin["differing"]):
        say(f"warning: not all rows are of the same software ({differing}); name all datasets and methods")
    for sentence in evaluation.made_again:
        say(f"made again: {sentence}")
    say(f"report: {out / 'evaluation.html'}")
    say_next_page(out / "evaluation.html")


@app.command
def verify(folder: Path, *, json: Json = False) -> None:
    """Compare every file of a dataset, a collection, results or an evaluation with its manifest.

    Names what is missing, truncated or changed, and what the manifest does not list.

    Examples of use:

        pcii verify out/paper-results
        pcii verify out/paper --json

    Parameters
    ----------
    folder
        Folder of a dataset, of a collection, of results or of an evaluation.
    json
        Print the number of files, or what is wrong, as JSON.
    """
    from pcii.store.verification import verify_and_tell

    verify_and_tell(folder, as_json=json)


def main() -> int:
    """Entry point of the `pcii` command."""
    return command_line.run(app, resuming=("run", "evaluate", "benchmark"))

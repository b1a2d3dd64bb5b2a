"""The `pcii` command."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pcii.app.benchmark_commands import benchmark, say_scores
from pcii.app.command_options import Out, SectionDepths, Workers
from pcii.app.import_commands import import_dataset
from pcii.app.step_commands import depth, reconstruct, run, score, segment
from pcii.base import THIS_PROCESS, Stages, command_line, results_folder, say, say_next
from pcii.evaluation import comparison
from pcii.exchange import export
from pcii.store import copy_sample, print_verification

app = command_line.command_app(
    "pcii", "Reconstruct photon-counted integral images, remove defocused points, and score the result."
)

app.command(import_dataset, name="import")
for command in (run, reconstruct, depth, segment, score, benchmark, export):
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
    copy_sample(out)
    say(f"{out}")
    say_next("pcii", "run", out, "-o", results_folder(out))


@app.command
def evaluate(
    datasets: tuple[Path, ...],
    *,
    out: Out,
    method: tuple[str, ...] = (),
    budget: tuple[str, ...] = (),
    z_mm: SectionDepths = (),
    executor: Workers = THIS_PROCESS,
) -> None:
    """Compare methods over datasets and photon budgets, with intervals over seeds; resumes when run again.

    Writes evaluation.html and means.csv, and each score, as it is measured, to rows.jsonl.
    Scores that other software made are made again.

    Examples of use:

        pcii evaluate out/paper20 -o out/compared
        pcii evaluate out/paper20 out/slats20 -o out/compared --method depth:sweep-17 --budget 300 --workers 2

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
    """
    with Stages() as report:
        evaluation = comparison.evaluate(
            datasets, out, methods=method, budgets=budget, z_mm=z_mm, executor=executor, report=report
        )
    if differing := ", ".join(evaluation.origin["differing"]):
        say(f"warning: not all rows are of the same software ({differing}); name all datasets and methods")
    say_scores(out, evaluation)


@app.command
def verify(folder: Path, *, json: Annotated[bool, Parameter(name="--json")] = False) -> None:
    """Compare every file of a dataset, a collection, results or an evaluation with its manifest.

    Names what is missing, truncated or changed, and what the manifest does not list, and says where other
    software made results.

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
    print_verification(folder, as_json=json)


def main() -> int:
    """Entry point of the `pcii` command."""
    return command_line.run(app, resuming=("evaluate", "benchmark"))

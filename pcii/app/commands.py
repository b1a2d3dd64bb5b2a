"""The `pcii` command, and `pcii benchmark`."""

import shutil
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from pcii.app.import_commands import import_dataset
from pcii.app.step_commands import STEPS, Out, SectionDepths, Workers
from pcii.base import (
    THIS_PROCESS,
    Stages,
    command_line,
    new_folder_safely,
    results_folder,
    say,
    say_next,
    say_next_page,
)
from pcii.evaluation import (
    Evaluation,
    comparison,
    decisive_means,
    open_benchmark,
    run_method,
    score_submission,
    write_page,
)
from pcii.exchange import export
from pcii.store import SAMPLE, Half, check_free, print_verification

Data = Annotated[Path, Parameter(help="Folder of the benchmark, which `simgen benchmark make` makes.")]
OfHalf = Annotated[Half, Parameter(help="Methods are tuned on the one and reported on the other.")]
ScoresOut = Annotated[Out, Parameter(help="Folder for the scores: new, empty, or those of an earlier call.")]

app = command_line.command_app(
    "pcii", "Reconstruct photon-counted integral images, remove defocused points, and score the result."
)
benchmark = App(
    name="benchmark",
    help="""Score methods on the public benchmark, and make a page of all scores.

    Examples of use:

        pcii benchmark run three-step --data out/pcii-bench-1 -o submissions/three-step
        pcii benchmark page submissions -o benchmark.html
    """,
)

app.command(import_dataset, name="import")
for command in (*STEPS, benchmark, export):
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
    check_free(out, "dataset")
    out.parent.mkdir(parents=True, exist_ok=True)
    with new_folder_safely(out) as folder:
        shutil.copytree(SAMPLE, folder, dirs_exist_ok=True)
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
    _say_scores(out, evaluation)


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


@benchmark.command
def run(
    method: str,
    *,
    data: Data,
    out: ScoresOut,
    half: OfHalf = "test",
    budget: tuple[str, ...] = (),
    authors: str | None = None,
    url: str | None = None,
    trained_on: str | None = None,
    executor: Workers = THIS_PROCESS,
) -> None:
    """Run a method on the datasets of a benchmark and score it; run again to resume.

    Examples of use:

        pcii benchmark run three-step --data out/pcii-bench-1 -o out/three-step
        pcii benchmark run my_method.py:remove --data out/pcii-bench-1 --half development -o out/my-removal

    Parameters
    ----------
    method
        A method of removal, or depth:NAME; or module:function or file.py:function, after depth: for depth.
    budget
        The only photons per view to score at, or full-light; may be repeated. For a first look.
    authors
        Whose method it is, for the page of all submissions.
    url
        Where its code or its paper is.
    trained_on
        What a network has seen.
    """
    about = {"authors": authors, "url": url, "trained_on": trained_on}
    with Stages() as report:
        opened = open_benchmark(data, half)
        if opened.missing:
            whole = len(opened.datasets) + opened.missing
            say(
                f"{data}: {opened.missing} of {whole} datasets of the {half} half are missing; the scores are"
            )
            say(f"of the others. The same `simgen benchmark make -o {data}` goes on with it")
        evaluation = run_method(
            method, opened, out, budgets=budget, executor=executor, report=report, **about
        )
    _say_scores(out, evaluation)


@benchmark.command
def score(
    folder: Path, *, data: Data, out: ScoresOut, half: OfHalf = "test", executor: Workers = THIS_PROCESS
) -> None:
    """Score maps of depth and masks that were made elsewhere, after checking all of them.

    FOLDER has submission.json, and for each dataset and light a folder such as ramp_photons_1/1000 with
    depth.npz, masks.npz or both.

    Example of use:

        pcii benchmark score my-results --data out/pcii-bench-1 -o out/my-scores

    Parameters
    ----------
    folder
        Folder of the results.
    """
    with Stages() as report:
        evaluation = score_submission(
            folder, open_benchmark(data, half), out, executor=executor, report=report
        )
    _say_scores(out, evaluation)


@benchmark.command
def page(folder: Path, *, out: Out) -> None:
    """Make one page of all submissions in a folder: tables that can be sorted, and lines over light.

    Example of use:

        pcii benchmark page submissions -o benchmark.html

    Parameters
    ----------
    folder
        Folder of folders that `pcii benchmark run` or `score` have written.
    out
        The page to write, in a folder that exists.
    """
    count = write_page(folder, out)
    say(f"{out}: scores of {count} submission(s)")
    say_next_page(out)


def _say_scores(out: Path, evaluation: Evaluation) -> None:
    """Say which datasets of an evaluation were scored, why some were scored again, and the decisive means."""
    for sentence in evaluation.made_again:
        say(f"made again: {sentence}")
    for title, table in decisive_means(evaluation.means()):
        say(f"\n{title} by photons per view\n{table}\n")
    count = evaluation.frame["identity"].nunique()
    say(f"{out / 'evaluation.html'}: scores of {count} dataset{'' if count == 1 else 's'}")
    say_next_page(out / "evaluation.html")


def main() -> int:
    """Entry point of the `pcii` command."""
    return command_line.run(app, resuming=("evaluate", "benchmark"))

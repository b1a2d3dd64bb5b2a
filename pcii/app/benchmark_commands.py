"""The command `pcii benchmark`."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from pcii.app.command_options import Out, Workers
from pcii.base import THIS_PROCESS, Stages, say, say_next_page
from pcii.evaluation import (
    Evaluation,
    decisive_means,
    open_benchmark,
    run_method,
    score_submission,
    write_page,
)
from pcii.store import Half

Data = Annotated[Path, Parameter(help="Folder of the benchmark, which `simgen benchmark make` makes.")]
OfHalf = Annotated[Half, Parameter(help="Methods are tuned on the one and reported on the other.")]
ScoresOut = Annotated[Out, Parameter(help="Folder for the scores: new, empty, or those of an earlier call.")]

benchmark = App(
    name="benchmark",
    help="""Score methods on the public benchmark, and make a page of all scores.

    Examples of use:

        pcii benchmark run three-step --data out/pcii-bench-1 -o submissions/three-step
        pcii benchmark page submissions -o benchmark.html
    """,
)


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
    say_scores(out, evaluation)


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
    say_scores(out, evaluation)


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


def say_scores(out: Path, evaluation: Evaluation) -> None:
    """Say which datasets of an evaluation were scored, why some were scored again, and the decisive means."""
    for sentence in evaluation.made_again:
        say(f"made again: {sentence}")
    for title, table in decisive_means(evaluation.means()):
        say(f"\n{title} by photons per view\n{table}\n")
    count = evaluation.frame["identity"].nunique()
    say(f"{out / 'evaluation.html'}: scores of {count} dataset{'' if count == 1 else 's'}")
    say_next_page(out / "evaluation.html")

"""The command `simgen benchmark`."""

from typing import Annotated

from cyclopts import App, Parameter

from pcii.base.command_output import complain_of, say, say_next
from pcii.base.executor import ALONE, Executor
from pcii.base.progress import Stages
from pcii.io.collection_layout import Half
from simgen.app.scene_commands import Out

benchmark = App(
    name="benchmark",
    help="""Make the public benchmark, and certify it.

    Example of use:

        simgen benchmark make -o out/bench
    """,
)


@benchmark.command
def make(
    name: str = "pcii-bench-1",
    *,
    out: Out,
    half: Half | None = None,
    scene: tuple[str, ...] = (),
    executor: Annotated[Executor, Parameter(name="*")] = ALONE,
) -> int:
    """Make the datasets of a benchmark, and compare them with the published ones; run again to resume.

    OUT is a collection with a folder for each dataset, and certificate.json, which says whether they have the
    published bytes or, on another kind of machine, are draws of the same light, on which a simple method has
    the published scores.

    Examples of use:

        simgen benchmark make -o out/bench
        simgen benchmark make -o out/bench --half development --workers 2
        simgen benchmark make -o out/bench --scene ball-and-bird --scene foliage

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
    from pcii.io.benchmark_layout import CERTIFICATE
    from simgen.dataset.benchmark_making import certify, load_definition, make_benchmark
    from simgen.renderer import backend

    definition, file = load_definition(name)
    say(f"backend: {backend.choose().line()}")
    with Stages() as report:
        faults = make_benchmark(
            definition, file, out, half=half, names=scene, executor=executor, report=report
        )
        verdict = None if faults else certify(definition, file, out, report)
    problems = faults if verdict is None else verdict.problems
    complain_of(problems, "" if verdict is not None else "not made: ")
    if verdict is not None:
        say(f"{out / CERTIFICATE}: {verdict.sentence()}")
        say_next("pcii", "benchmark", "run", "likelihood", "--data", out, "-o", out.parent / "submission")
    return 1 if problems else 0

"""The `pcii` command."""

from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter

from pcii.app.import_commands import import_dataset
from pcii.app.results import Results
from pcii.base import command_line
from pcii.base.command_line import say
from pcii.base.crew import ALONE, Crew
from pcii.base.progress import Stages
from pcii.io.dataset import Dataset, open_dataset

app = App(
    name="pcii",
    help="Reconstruct photon-counted integral images, remove defocused points, and score the result.",
    version=lambda: version("photon-integral-imaging"),
    default_parameter=Parameter(converter=command_line.converted),
)

app.command(import_dataset, name="import")

Out = Annotated[Path, Parameter(name=("--out", "-o"))]
Depths = Annotated[tuple[float, ...], Parameter(name="--z-mm")]
Without = Annotated[tuple[Literal["threshold", "boundary", "entropy"], ...], Parameter(negative="")]
Budget = Annotated[float | None, Parameter(help="Use the photons of this smaller, nested budget.")]


def _open(dataset: Path, budget: float | None) -> Dataset:
    data = open_dataset(dataset)
    return data if budget is None else data.at_budget(budget)


@app.command
def run(
    dataset: Path, *, out: Out, z_mm: Depths = (), method: tuple[str, ...] = (), budget: Budget = None
) -> None:
    """Analyse a dataset completely: sections, removal by each method, depth, scores, report.html.

    Example:  pcii run out/paper -o out/paper-results

    Parameters
    ----------
    dataset
        A dataset folder, as made by `simgen generate`.
    out
        Folder for the results: new, empty, or that of earlier results of the same dataset.
    z_mm
        Depth of a section in mm; repeat for more. Default: the depths that the recipe names.
    method
        A method of removal, as in `pcii segment`; repeat for more. Default: three-step and likelihood.
    """
    from pcii.app.single_run import run as run_all

    with Stages() as report:
        outcome = run_all(_open(dataset, budget), out, z_mm, report, method or None)
    for row in outcome.score.planes:
        if row["truth"] == "object" and row["iou"] is not None:
            say(f"{row['z_mm']:g} mm, {row['method']}: IoU {row['iou']:.3f} ({row['object']})")
    if not outcome.focus:
        say("sections and depth only: removal needs photon counts; import the images with --photons N")
    say(f"report: {out / 'report.html'}")


@app.command
def reconstruct(
    dataset: Path,
    *,
    out: Out,
    z_mm: Depths = (),
    subpixel: int = 1,
    shifts: Literal["nearest", "even"] = "nearest",
    budget: Budget = None,
) -> None:
    """Reconstruct sections from the photon counts, or else the radiance, with a picture of each.

    Example:  pcii reconstruct out/paper --z-mm 540 --z-mm 620 -o out/sections

    Parameters
    ----------
    dataset
        A dataset folder.
    out
        Folder for the results.
    z_mm
        Depth of a section in mm; repeat for more. Default: the depths that the recipe names.
    subpixel
        Divide each pixel into this many voxels per axis.
    shifts
        `even` adds raw Bayer samples, as the paper does, and demosaics the picture afterwards.
    """
    from pcii.imaging.pictures import to_srgb8, white_level, write_png
    from pcii.io.suggested_depths import planes_of
    from pcii.sections.demosaicing import demosaic
    from pcii.sections.reconstruction import reconstruct as make

    data = _open(dataset, budget)
    sections = make(data.counts_or_views, planes_of(data, z_mm), subpixel=subpixel, shifts=shifts)
    with Results(out, data).writing() as results:
        say(f"{results.save_sections(sections)}")
        for z, estimate in zip(sections.z_mm, sections.estimate, strict=True):
            if sections.cfa is not None:
                estimate = demosaic(estimate[..., 0], cfa=sections.cfa)
            picture = to_srgb8(estimate, white_level(estimate, (slice(None), slice(None))))
            with results.replacing(f"section_{z:g}mm.png") as path:
                write_png(path, picture)
            say(f"{out / path.name}")


@app.command
def depth(dataset: Path, *, out: Out, method: str | None = None, budget: Budget = None) -> None:
    """Map the depth of every pixel of the virtual centre, from photon counts or else radiance.

    Example:  pcii depth out/paper --method focus -o out/depth

    Parameters
    ----------
    dataset
        A dataset folder.
    out
        Folder for the results.
    method
        posterior (default) or variance-sweep; of counts also focus or likelihood-sweep, of radiance also
        structure-tensor; or one that a package registers.
    """
    from pcii.depth.methods import estimate_depth
    from pcii.imaging.pictures import depth_image, write_png
    from pcii.io.suggested_depths import depth_range_of

    data = _open(dataset, budget)
    z_range = depth_range_of(data)
    depth_map = estimate_depth(data.counts_or_views, z_range, method=method)
    with Results(out, data).writing() as results:
        say(f"{results.save_depth(depth_map)}")
        with results.replacing("depth.png") as path:
            write_png(path, depth_image(depth_map.z_mm, *z_range, depth_map.confidence))
    say(f"{out / 'depth.png'}: {z_range[0]:g} mm is yellow, {z_range[1]:g} mm violet, darker where less sure")


@app.command
def segment(
    dataset: Path,
    *,
    out: Out,
    z_mm: Depths = (),
    method: str = "likelihood",
    without: Without = (),
    subpixel: int = 1,
    budget: Budget = None,
) -> None:
    """Remove defocused points from sections, with a picture of each mask.

    Example:  pcii segment out/paper --z-mm 540 --method three-step -o out/removed

    Example:  pcii segment out/paper --method three-step --without entropy --subpixel 2 -o out/removed

    Parameters
    ----------
    dataset
        A dataset folder.
    out
        Folder for the results.
    z_mm
        Depth of a section in mm; repeat for more. Default: the depths that the recipe names.
    method
        three-step (of the paper), likelihood (Poisson), brightness, variance or shape-from-focus (for
        comparison), or a method that an installed package registers.
    without
        Leave out one of the three steps; repeat for more.
    subpixel
        Find the outlines of the three steps on this many voxels per pixel and axis.
    """
    from pcii.base.errors import InputError
    from pcii.imaging.pictures import mask_image, write_png
    from pcii.io.suggested_depths import planes_of
    from pcii.removal.methods import find_method
    from pcii.removal.methods import segment as remove
    from pcii.removal.three_step.three_step_method import ThreeStep

    if method != "three-step" and (without or subpixel != 1):
        option = "--without" if without else "--subpixel"
        raise InputError(f"{option}: is for --method three-step, not {method}")
    chosen = find_method(method)
    if method == "three-step":
        chosen = ThreeStep(subpixel, **dict.fromkeys(without, False))
    data = _open(dataset, budget)
    focus = remove(data.counts, planes_of(data, z_mm), method=chosen)
    with Results(out, data).writing() as results:
        say(f"{results.save_segmented(focus)}")
        for z, mask in zip(focus.z_mm, focus.in_focus, strict=True):
            with results.replacing(f"in_focus_{focus.method}_{z:g}mm.png") as path:
                write_png(path, mask_image(mask))
            say(f"{out / path.name}: {mask.mean():.2%} of the section in focus")


@app.command
def score(dataset: Path, out: Path, *, budget: Budget = None) -> None:
    """Compare the results in a folder with the dataset's truth, and write score.json into it.

    Example:  pcii score out/paper out/paper-results

    Parameters
    ----------
    dataset
        The dataset folder, with truth.
    out
        The folder of results of `pcii run`, `pcii segment` or `pcii depth`.
    """
    from pcii.app.pipeline import full_light_sections
    from pcii.base.errors import InputError
    from pcii.core.focal_planes import FocalPlanes
    from pcii.metrics.scoring import score as compare

    data = _open(dataset, budget)
    if not out.is_dir():
        raise InputError(f"{out}: there is no such folder of results")
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
        say(f"{results.save_score(result)}")


@app.command
def evaluate(
    datasets: Annotated[tuple[Path, ...], Parameter(negative=())],
    *,
    out: Out,
    method: Annotated[tuple[str, ...], Parameter(negative=())] = (),
    budget: Annotated[tuple[str, ...], Parameter(negative=())] = (),
    crew: Annotated[Crew, Parameter(name="*")] = ALONE,
) -> None:
    """Compare methods over datasets and photon budgets, with intervals over seeds; resumes when run again.

    Writes evaluation.json, evaluation.html and evaluation.md, and each score, as it is measured, to
    rows.jsonl.

    Examples:

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
        one); may be repeated. Default: all that can take the data.
    budget
        A photon budget that every dataset has, or full-light: its radiance; may be repeated. Default: all.
    """
    from pcii.evaluation.comparison import evaluate as compare

    with Stages() as report:
        compare(datasets, out, methods=method, budgets=budget, crew=crew, report=report)
    say(f"report: {out / 'evaluation.html'}")


@app.command
def verify(folder: Path) -> None:
    """Compare every file of a dataset, a collection, results or an evaluation with its manifest.

    Names what is missing, truncated or changed, and what the manifest does not list.

    Example:  pcii verify out/paper-results

    Parameters
    ----------
    folder
        Folder of a dataset, of a collection, of results or of an evaluation.
    """
    from pcii.io.verification import verify as compare

    with Stages() as report:
        count = compare(folder, report)
    say(f"{folder}: {count} files match the manifest")


def main() -> int:
    """Entry point of the `pcii` command."""
    return command_line.run(app, resuming=("evaluate",))

"""Commands that analyse one dataset: all steps, sections, depth, removal, score; and options of commands."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import CoercionError, Parameter, Token

from pcii.app import results
from pcii.app.pipeline import Outcome, surface_depths
from pcii.base import (
    Executor,
    InputError,
    Stages,
    say,
    say_next,
    say_next_page,
    write_bytes_safely,
    write_json_safely,
)
from pcii.depth import DEFAULT_METHOD, estimate_depth
from pcii.figures import NOT_KNOWN, draw_depth, exposed, figure_bytes, mask_image, new_figure, write_png
from pcii.metrics import scoring
from pcii.removal import methods as removal
from pcii.sections import depth_range_of, has_depths, planes_of
from pcii.sections import reconstruct as reconstruct_sections
from pcii.store import RESULTS_FOLDER, Dataset, differences, open_dataset, own_software
from pcii.types import MOST_DEPTHS, DepthMap, FocalPlanes, Light, Segmented

DEPTH_IN = 9.0
"""Longest side of the picture of a depth map with its scale."""
MIN_ANSWERED_SHARE = 0.1
"""Smallest share of the photons that a depth map answers for without a warning."""


def depths_mm(text: str) -> list[float]:
    """Depths as they are typed: one number, or start:stop:step with the stop if a step meets it.

    Raises ValueError for anything else.

    >>> depths_mm("540"), depths_mm("500:560:20"), depths_mm("500:550:20")
    ([540.0], [500.0, 520.0, 540.0, 560.0], [500.0, 520.0, 540.0])
    """
    try:
        numbers = [float(part) for part in text.split(":")]
    except ValueError:
        numbers = []
    if len(numbers) == 1:
        return numbers
    if len(numbers) == 3 and all(map(math.isfinite, numbers)):
        start, stop, step = numbers
        if step > 0 and start <= stop and (stop - start) / step < MOST_DEPTHS:
            # Steps such as 0.1 are not exact in binary; the stop counts as met within a millionth of a step.
            return [start + number * step for number in range(math.floor((stop - start) / step + 1e-6) + 1)]
    raise ValueError(
        "expected a depth in mm such as 540, or start:stop:step such as 500:700:20 of at most "
        f"{MOST_DEPTHS} depths, got {text!r}"
    )


def _all_depths_mm(kind: Any, tokens: Sequence[Token]) -> tuple[float, ...]:
    depths: list[float] = []
    for token in tokens:
        try:
            depths += depths_mm(token.value)
        except ValueError as fault:  # with the token, so that the option is named whichever value is wrong
            raise CoercionError(msg=str(fault), token=token) from None
    return tuple(depths)


Workers = Annotated[Executor, Parameter(name="*")]
Out = Annotated[Path, Parameter(name=("--out", "-o"))]
ResultsOut = Annotated[Out, Parameter(help="Folder for the results: new, or with results of this dataset.")]
DatasetFolder = Annotated[Path, Parameter(help="A dataset folder.")]
Depths = Annotated[tuple[float, ...], Parameter(name="--z-mm", converter=_all_depths_mm)]
SectionDepths = Annotated[
    Depths,
    Parameter(
        help="Depth of a section in mm, or start:stop:step; repeat for more. Default: those that the dataset "
        "suggests."
    ),
]
ExpectedDepths = Annotated[
    Depths,
    Parameter(
        help="Depth in mm of a plane in which objects are expected, or start:stop:step; repeat for more. "
        "Default: those that the dataset suggests. Only the method posterior uses them."
    ),
]
DepthRange = Annotated[
    tuple[float, float] | None,
    Parameter(
        help="Nearest and farthest depth to search, in mm. Default: the range that the dataset suggests, or "
        "4/5 of its nearest to 5/4 of its farthest depth."
    ),
]
Budget = Annotated[
    str | None,
    Parameter(help="Use the photons of this smaller, nested budget, or full-light: the radiance alone."),
]


def run(
    dataset: DatasetFolder,
    *,
    out: ResultsOut,
    z_mm: SectionDepths = (),
    z_range_mm: DepthRange = None,
    method: tuple[str, ...] = (),
    depth_method: str = DEFAULT_METHOD,
    budget: Budget = None,
) -> None:
    """Analyse a dataset completely: sections, removal by each method, depth, scores, report.html.

    Everything is computed again, and replaces earlier results of the dataset in OUT.

    Examples of use:

        pcii run out/paper -o out/paper-results
        pcii run out/paper -o out/paper-stack --z-mm 500:700:20 --method three-step --z-range-mm 450 750

    Parameters
    ----------
    method
        A method of removal, as in `pcii segment`; repeat for more. Default: three-step and posterior.
    depth_method
        A method of depth, as in `pcii depth`.
    """
    data = _opened(dataset, budget)
    if z_range_mm is None or has_depths(data, z_mm):
        planes = planes_of(data, z_mm)
    else:
        depths_mm, sentence = surface_depths(data.counts_or_views, z_range_mm, depth_method)
        if not depths_mm:
            raise InputError(f"{data.path}: no depth is found in the range; name depths with --z-mm")
        say(sentence)
        planes = FocalPlanes.at_depths(data.grid, depths_mm)
    z_range_mm = z_range_mm or depth_range_of(data, z_mm)
    with Stages() as report:
        outcome = results.run(data, out, planes, z_range_mm, method, depth_method, report)
    for lines in _result_tables(outcome):
        say(f"\n{lines}\n")
    if not outcome.focus:
        say("sections and depth only: removal needs photon counts; import the images with --photons N")
    _say_hot_pixels(outcome.depth)
    _warn_of_few_depths(outcome.depth, data, z_range_mm)
    say(f"report: {out / results.REPORT}")
    say_next_page(out / results.REPORT)


def reconstruct(
    dataset: DatasetFolder,
    *,
    out: ResultsOut,
    z_mm: SectionDepths = (),
    subpixel: int = 1,
    budget: Budget = None,
) -> None:
    """Reconstruct sections from the photon counts, or else the radiance, with a picture of each.

    Example of use:

        pcii reconstruct out/paper --z-mm 500:700:20 -o out/paper-sections

    Parameters
    ----------
    subpixel
        Divide each pixel into this many voxels per axis.
    """
    data = _opened(dataset, budget)
    planes = planes_of(data, z_mm)
    with results.writing(out, data) as folder:
        sections = reconstruct_sections(data.counts_or_views, planes, subpixel=subpixel)
        results.save_result(folder, sections)
        pictures = exposed(zip(sections.counts, sections.coverage, strict=True), 1)
        for z, picture in zip(sections.z_mm, pictures, strict=True):
            write_png(folder / f"section_{z:g}mm.png", picture)
    say(f"{out / results.SECTIONS}, with a picture of each, such as section_{planes.z_mm[0]:g}mm.png")
    saturated = int(np.count_nonzero(np.isinf(sections.estimate)))
    if saturated:
        say(f"{saturated} of {sections.counts.size} voxels are saturated: their estimate is infinite")
    if data.has_counts:
        depths = (f"--z-mm={z:g}" for z in z_mm)
        say_next("pcii", "segment", dataset, *depths, "-o", out, *(["--budget", budget] if budget else []))


def depth(
    dataset: DatasetFolder,
    *,
    out: ResultsOut,
    z_range_mm: DepthRange = None,
    z_mm: ExpectedDepths = (),
    method: str = DEFAULT_METHOD,
    budget: Budget = None,
) -> None:
    """Map the depth of every pixel of the virtual centre, from photon counts or else radiance.

    Example of use:

        pcii depth out/paper --method sweep-17 --z-range-mm 450 750 -o out/paper-depth

    Parameters
    ----------
    method
        posterior or variance-sweep; of counts also sweep-9, sweep-17 or sweep-33, of radiance also
        structure-tensor; or one that a package registers, module:function, or file.py:function.
    """
    data = _opened(dataset, budget)
    near, far = z_range_mm or depth_range_of(data, z_mm)
    planes = planes_of(data, z_mm) if has_depths(data, z_mm) else None
    with results.writing(out, data) as folder:
        depth_map = estimate_depth(data.counts_or_views, (near, far), z_mm=planes, method=method)
        results.save_result(folder, depth_map)
        figure = new_figure(DEPTH_IN, DEPTH_IN, "compressed")
        draw_depth(depth_map, figure.subplots(), (near, far))
        write_bytes_safely(folder / "depth.png", figure_bytes(figure))
    say(f"{out / 'depth.png'}: {near:g} mm is yellow, {far:g} mm violet, paler where less sure")
    _say_hot_pixels(depth_map)
    _warn_of_few_depths(depth_map, data, (near, far))
    _say_next_score(data, out)


def segment(
    dataset: DatasetFolder,
    *,
    out: ResultsOut,
    z_mm: SectionDepths = (),
    method: str = "posterior",
    budget: Budget = None,
) -> None:
    """Remove defocused points from sections, with a picture of each mask.

    Example of use:

        pcii segment out/paper --z-mm 540 --method three-step -o out/paper-removed

    Parameters
    ----------
    method
        posterior (by the network of depth), three-step (of the paper), brightness, variance or
        shape-from-focus (for comparison); or one that a package registers, module:function, or
        file.py:function.
    """
    data = _opened(dataset, budget)
    planes = planes_of(data, z_mm)
    with results.writing(out, data) as folder:
        z_range_mm = depth_range_of(data, z_mm)
        focus = removal.segment(data.counts, planes, z_range_mm=z_range_mm, method=method)
        results.save_result(folder, focus)
        for z, mask in zip(focus.z_mm, focus.in_focus, strict=True):
            write_png(folder / f"in_focus_{focus.method}_{z:g}mm.png", mask_image(mask))
    shares = zip(focus.z_mm, focus.in_focus.mean(axis=(1, 2)), strict=True)
    say(f"{out}: in focus are " + ", ".join(f"{share:.2%} at {z:g} mm" for z, share in shares))
    _say_hot_pixels(focus)
    _say_next_score(data, out)


def score(dataset: DatasetFolder, out: Path) -> None:
    """Compare the results in a folder with the dataset's truth, and write score.json into it.

    Example of use:

        pcii score out/paper out/paper-results

    Parameters
    ----------
    out
        The folder of results of `pcii run`, `pcii segment` or `pcii depth`.
    """
    manifest = RESULTS_FOLDER.read(out)
    data = _opened(dataset, manifest.light)
    focus, depth_map = results.load_estimates(out, data)
    if difference := differences(manifest.versions, own_software()):
        say(f"{out}: other software made these results: {difference}")
    planes = focus[0].sections.planes if focus else planes_of(data) if has_depths(data) else None
    with results.writing(out, data) as folder:
        views = data.views if data.truth and planes else None
        full_light = reconstruct_sections(views, planes) if views and planes else None
        options = {"grid": data.grid, "full_light": full_light, "dataset": data.name}
        result = scoring.score(focus, depth_map, data.truth, **options)
        write_json_safely(folder / results.SCORE, result.to_dict())
    say(f"{out / results.SCORE}")
    if data.truth is None:
        say("the dataset has no truth: what is compared with it is null")
    else:
        say_next("pcii", "evaluate", dataset, "-o", out.parent / f"{dataset.name}-compared")


STEPS = (run, reconstruct, depth, segment, score)


def _opened(folder: Path, budget: float | str | None) -> Dataset:
    """The dataset with the photons of this budget, None: of its recipe's; or its radiance, at full light."""
    dataset = open_dataset(folder)
    return dataset if budget is None else dataset.at_light(Light.parse(budget))


def _result_tables(outcome: Outcome) -> Iterator[str]:
    """Lines for a terminal: IoU by method and plane, then how right depth is, as far as the truth tells."""
    import pandas as pd

    truth = outcome.dataset.truth
    kind = "object" if truth is None else truth.mask_kind
    rows = [row for row in outcome.score.planes if row["truth"] == kind and row["iou"] is not None]
    if rows:
        other = "nothing" if kind == "object" else "all in focus"
        columns = {row["z_mm"]: f"{row['z_mm']:g} mm, {row['object'] or other}" for row in rows}
        iou = pd.DataFrame(rows).pivot(index="method", columns="z_mm", values="iou")
        iou = iou.rename(columns=columns).rename_axis(index=None, columns=None)
        yield f"IoU of the masks\n{iou.to_string(float_format='{:.3f}'.format, na_rep=NOT_KNOWN)}"
    depth = outcome.score.depth
    if truth is not None and depth["within_1px"] is not None:
        pixels = "the objects' pixels" if truth.has_objects else "all pixels with a true depth"
        names = {"within_1px": "within 1 px", "within_3px": "within 3 px", "coverage": "answered"}
        shares = pd.DataFrame([{text: depth[name] for name, text in names.items()}], [outcome.depth_method])
        yield f"Depth, shares of {pixels}\n{shares.to_string(float_format='{:.3f}'.format)}"


def _say_hot_pixels(estimate: Segmented | DepthMap) -> None:
    if estimate.hot_pixels:
        say(f"hot pixels of the sensor, taken from a neighbour in all views: {estimate.hot_pixels}")


def _warn_of_few_depths(depth_map: DepthMap, data: Dataset, z_range_mm: tuple[float, float]) -> None:
    """Say if a depth map answers for little of the photons, or of the pixels of radiance, and why."""
    grid, weight = data.grid, np.ones_like(depth_map.z_mm)
    if data.has_counts:  # in the dark there is nothing to answer for
        weight = reconstruct_sections(data.counts, float(np.mean(z_range_mm))).counts[0].sum(axis=-1)
    share = float(weight[np.isfinite(depth_map.z_mm)].sum() / max(weight.sum(), 1))
    what, reason = "pixels", "the views show too little texture"
    if data.has_counts:
        what, reason = "photons", f"{data.counts.total / grid.view_count:.4g} photons in a view are too few"
    if min(grid.rows, grid.cols) == 1:
        reason = f"the {grid.rows} x {grid.cols} cameras stand in a line, and see depth at few edges"
    if share < MIN_ANSWERED_SHARE:
        say(f"warning: {share:.1%} of the {what} have a depth, most likely since {reason}")


def _say_next_score(data: Dataset, out: Path) -> None:
    if data.has_truth_array("z_mm"):
        say_next("pcii", "score", data.path, out)

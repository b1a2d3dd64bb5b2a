"""Commands for single steps of the analysis: sections, depth, removal."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from pcii.app.command_options import Budget, Depths, Out, budget_words, opened
from pcii.app.results import Results
from pcii.base.command_line import say, say_next
from pcii.store.dataset import Dataset

Steps = Annotated[tuple[Literal["threshold", "boundary", "entropy"], ...], Parameter(name="--without")]


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

    Examples of use:

        pcii reconstruct out/paper --z-mm 540 --z-mm 620 -o out/sections
        pcii reconstruct out/paper --z-mm 500:700:20 -o out/sections

    Parameters
    ----------
    dataset
        A dataset folder.
    out
        Folder for the results.
    z_mm
        Depth of a section in mm, or start:stop:step; repeat for more. Default: the depths that the recipe
        names.
    subpixel
        Divide each pixel into this many voxels per axis.
    shifts
        `even` adds raw Bayer samples, as the paper does, and demosaics the picture afterwards.
    """
    from pcii.figures.pictures import to_srgb8, white_level, write_png
    from pcii.sections.demosaicing import demosaic
    from pcii.sections.reconstruction import reconstruct as make
    from pcii.store.suggested_depths import planes_of

    data = opened(dataset, budget)
    sections = make(data.counts_or_views, planes_of(data, z_mm), subpixel=subpixel, shifts=shifts)
    with Results(out, data).writing() as results:
        say(f"{results.save_sections(sections)}")
        full = int(np.count_nonzero(sections.saturated))
        if full:
            say(f"{full} of {sections.counts.size} voxels are saturated: their estimate is infinite")
        for z, estimate in zip(sections.z_mm, sections.estimate, strict=True):
            estimate = np.minimum(estimate, estimate.max(initial=0, where=np.isfinite(estimate)))
            if sections.cfa is not None:
                estimate = demosaic(estimate[..., 0], cfa=sections.cfa)
            picture = to_srgb8(estimate, white_level(estimate, (slice(None), slice(None))))
            with results.replacing(f"section_{z:g}mm.png") as path:
                write_png(path, picture)
            say(f"{out / path.name}")
    if data.has_counts:
        say_next("pcii", "segment", dataset, *(f"--z-mm={z:g}" for z in z_mm), "-o", out, *budget_words(data))


def depth(
    dataset: Path, *, out: Out, z_mm: Depths = (), method: str | None = None, budget: Budget = None
) -> None:
    """Map the depth of every pixel of the virtual centre, from photon counts or else radiance.

    Example of use:

        pcii depth out/paper --method focus -o out/depth

    Parameters
    ----------
    dataset
        A dataset folder.
    out
        Folder for the results.
    z_mm
        Depths of things in mm, as in `pcii segment`: where the recipe names no range, depth is searched from
        4/5 of the nearest to 5/4 of the farthest. Default: the depths that the recipe names.
    method
        posterior (default) or variance-sweep; of counts also focus or likelihood-sweep, of radiance also
        structure-tensor; or one that a package registers.
    """
    from pcii.depth.methods import estimate_depth
    from pcii.figures.pictures import depth_image, write_png
    from pcii.store.suggested_depths import depth_range_of

    data = opened(dataset, budget)
    z_range = depth_range_of(data, z_mm)
    depth_map = estimate_depth(data.counts_or_views, z_range, method=method)
    with Results(out, data).writing() as results:
        say(f"{results.save_depth(depth_map)}")
        with results.replacing("depth.png") as path:
            write_png(path, depth_image(depth_map.z_mm, *z_range, depth_map.confidence))
    say(f"{out / 'depth.png'}: {z_range[0]:g} mm is yellow, {z_range[1]:g} mm violet, greyer where less sure")
    _say_next_score(data, out)


def segment(
    dataset: Path,
    *,
    out: Out,
    z_mm: Depths = (),
    method: str = "likelihood",
    without: Steps = (),
    subpixel: int = 1,
    budget: Budget = None,
) -> None:
    """Remove defocused points from sections, with a picture of each mask.

    Examples of use:

        pcii segment out/paper --z-mm 540 --method three-step -o out/removed
        pcii segment out/paper --method three-step --without entropy --subpixel 2 -o out/removed

    Parameters
    ----------
    dataset
        A dataset folder.
    out
        Folder for the results.
    z_mm
        Depth of a section in mm, or start:stop:step; repeat for more. Default: the depths that the recipe
        names.
    method
        three-step (of the paper), likelihood (Poisson), posterior (of depth), brightness, variance or
        shape-from-focus (for comparison), or a method that an installed package registers.
    without
        Leave out one of the three steps; repeat for more.
    subpixel
        Find the outlines of the three steps on this many voxels per pixel and axis.
    """
    from pcii.base.errors import InputError
    from pcii.figures.pictures import mask_image, write_png
    from pcii.removal.methods import find_method
    from pcii.removal.methods import segment as remove
    from pcii.removal.three_step.three_step_method import ThreeStep
    from pcii.store.suggested_depths import planes_of

    if method != "three-step" and (without or subpixel != 1):
        option = "--without" if without else "--subpixel"
        raise InputError(f"{option}: is for --method three-step, not {method}")
    chosen = find_method(method)
    if method == "three-step":
        chosen = ThreeStep(subpixel, **dict.fromkeys(without, False))
    data = opened(dataset, budget)
    focus = remove(data.counts, planes_of(data, z_mm), method=chosen)
    with Results(out, data).writing() as results:
        say(f"{results.save_segmented(focus)}")
        for z, mask in zip(focus.z_mm, focus.in_focus, strict=True):
            with results.replacing(f"in_focus_{focus.method}_{z:g}mm.png") as path:
                write_png(path, mask_image(mask))
            say(f"{out / path.name}: {mask.mean():.2%} of the section in focus")
    _say_next_score(data, out)


def _say_next_score(dataset: Dataset, out: Path) -> None:
    if dataset.has_truth_array("z_mm"):
        say_next("pcii", "score", dataset.path, out, *budget_words(dataset))

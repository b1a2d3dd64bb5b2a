"""What the constants of depth by the posterior of a surface change, on the scenes that they are chosen by.

Each constant alone is halved and doubled. The figures are means over the train half of the scenes: the share
of the objects' pixels whose depth is off by more than 1 px of total disparity, or missing, and the expected
calibration error of the answers there. The variables of corpus.py say of which scenes, seeds and budgets.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.corpus import chosen_works, make
from pcii.base.progress import Stages
from pcii.depth.posterior_depth import PosteriorDepth
from pcii.evaluation.tables import Table, markdown
from pcii.metrics.depth_accuracy import depth_errors
from pcii.store.dataset import Dataset, open_dataset
from pcii.store.suggested_depths import depth_range_of
from pcii.types.estimates import DepthMap
from pcii.types.photon_limit import Light

CHOSEN = PosteriorDepth()
FACTORS = (0.5, 2.0)


def table() -> Iterator[str]:
    """Make the datasets that are missing, and try every variant on each of them."""
    works, budgets = chosen_works()
    works = [work for work in works if work.entry.half == "train"]
    variants = [("as chosen", CHOSEN), *_variants()]
    figures = np.full((len(variants), len(works), len(budgets), 2), np.nan)
    with Stages() as progress:
        make(works, progress)
        places = list(np.ndindex(len(works), len(budgets)))
        for done, place in enumerate(places, start=1):
            data = open_dataset(works[place[0]].folder).at_light(Light(budgets[place[1]]))
            for number, (_, method) in enumerate(variants):
                figures[number, *place] = _errors(data, method)
            progress("datasets and budgets", done, len(places))
    rows = [
        (name, *(f"{bad:.3f}, {ece:.3f}" for bad, ece in np.nanmean(own, axis=0)))
        for (name, _), own in zip(variants, figures, strict=True)
    ]
    shown = Table(
        f"Constants of depth: errors above 1 px, calibration error; {len(works)} datasets",
        ("constant", *(f"{budget:g}" for budget in budgets)),
        tuple(rows),
        words=1,
    )
    yield f"{shown.title}\n\n{markdown(shown)}"


def _variants() -> Iterator[tuple[str, PosteriorDepth]]:
    """Names and methods in which one number is halved or doubled."""
    for part in ("model", "prior", None):
        owner: Any = CHOSEN if part is None else getattr(CHOSEN, part)
        for name, value in vars(owner).items():
            if not isinstance(value, int | float):
                continue
            for factor in FACTORS:
                changed = replace(owner, **{name: type(value)(value * factor)})
                method = changed if part is None else replace(CHOSEN, **{part: changed})
                yield f"{name} = {type(value)(value * factor):g}", method


def _errors(data: Dataset, method: PosteriorDepth) -> tuple[float, float]:
    """`bad_1px`, and the calibration error of the answers on objects."""
    assert data.truth is not None
    depth = method(data.counts, depth_range_of(data))
    on_object = data.truth.object_id > 0
    z_mm = np.where(on_object, depth.z_mm, np.nan)
    only = DepthMap(z_mm, np.where(np.isfinite(z_mm), depth.confidence, 0))
    errors = depth_errors(data.grid, only, data.truth)
    return errors["bad_1px"], np.nan if errors["ece"] is None else errors["ece"]

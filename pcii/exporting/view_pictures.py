"""Pictures of 8 bits of a dataset's views, of one white for all: of radiance, else of photons."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import visible
from pcii.figures.pictures import to_srgb8
from pcii.io.dataset import Dataset
from pcii.sections.demosaicing import demosaic

WHITE_SHARE = 0.999
"""Share of the values in the middle view that are not brighter than white."""


@dataclass(frozen=True)
class ViewPictures:
    """The pictures, and what their numbers are."""

    view: Callable[[int, int], np.ndarray]
    """The picture of camera (k, l), uint8 (H, W, 3)."""
    quantity: Literal["radiance", "photons"]
    """Radiance is encoded as sRGB; photons are proportional to the numbers."""
    white: float
    """Radiance or photons of 255. It is one of the values, as float32: radiance that is made of the pictures
    again has it in the same place, so that pictures of that are the same."""
    unit: str
    meaning: str
    """What the numbers are, as the end of a sentence."""


def pictures_of(dataset: Dataset) -> ViewPictures:
    """Pictures of a dataset; mosaics of radiance are demosaiced, those of photons are grey.

    Raises `InputError` for a dataset with neither radiance nor photons.
    """
    grid, views = dataset.grid, dataset.views
    if views is not None:
        cfa, unit = views.cfa, visible(str(dataset.manifest.get("radiance_unit", "radiance")))

        def colours(k: int, l: int) -> np.ndarray:
            image = views.view(k, l)
            return image if cfa is None else demosaic(image[..., 0], cfa=cfa)

        middle = colours(grid.rows // 2, grid.cols // 2)
        white = float(np.float32(np.quantile(middle, WHITE_SHARE, method="lower")))
        white = white if white > 0 else 1.0
        how = "" if cfa is None else f", the {cfa} mosaic demosaiced by the method of Laroche and Prescott"
        return ViewPictures(
            lambda k, l: to_srgb8(colours(k, l), white),
            "radiance",
            white,
            unit,
            f"radiance, encoded as sRGB: 255 is {white:.6g} ({unit}) or more{how}",
        )
    if not dataset.has_counts:
        raise InputError(f"{dataset.path}: has neither radiance nor counts, so there are no images to export")
    counts = dataset.counts
    most = max(int(counts.events.n.max(initial=0)), 1)
    mosaic = (
        "" if counts.cfa is None else f"; in grey, since each pixel of the {counts.cfa} mosaic has one colour"
    )

    def photons(k: int, l: int) -> np.ndarray:
        return np.repeat(photon_numbers(counts.view(k, l), most)[..., None], 3, axis=2)

    meaning = f"photon counts, not gamma-encoded: 255 is {most} photons in the pixel, 0 none{mosaic}"
    return ViewPictures(photons, "photons", float(most), "photons", meaning)


def photon_numbers(counts: np.ndarray, most: float) -> np.ndarray:
    """Numbers, uint8, of counts of up to `most` photons; up to 255 each count has a number of its own."""
    return np.round(255 / most * counts).astype(np.uint8)

"""Patterns that surfaces can carry without an image file; how they are painted is in `paint`."""

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from pcii.base.srgb import srgb_to_linear
from simgen.base.strict_models import Colour, NonNegative, Real, Share, Strict, Whole

CLIPPED_SHARE = 0.01
"""No more than this share of a noise's values may lie outside what a surface can reflect."""

Cells = Annotated[Whole, Field(ge=1, le=1024)]


class _Pattern(Strict):
    pixels: Annotated[Whole, Field(ge=16, le=4096)] = 1024
    """Pixels along the longer side."""


class _InTwoColours(_Pattern):
    colours: tuple[Colour, Colour] = ((0.2, 0.2, 0.2), (0.95, 0.95, 0.95))
    """Two sRGB colours; by default black ink and white paper."""


class Checks(_InTwoColours):
    """A chessboard; the cell at the top left has the first colour."""

    type: Literal["checks"] = "checks"
    rows: Cells
    """Cells from top to bottom."""
    columns: Cells
    """Cells from left to right."""


class Stripes(_InTwoColours):
    """Even stripes, upright unless turned; the first begins at the left with the first colour."""

    type: Literal["stripes"] = "stripes"
    periods: Annotated[Real, Field(ge=1, le=1024)]
    """Pairs of stripes across the width; turned stripes keep this spacing."""
    angle_deg: Annotated[Real, Field(ge=-180, le=180)] = 0.0
    """Turns the stripes clockwise about the centre."""
    profile: Literal["square", "sine"] = "square"
    """Sharp borders, or reflectance that goes up and down as a sine."""


class Star(_InTwoColours):
    """A Siemens star about the centre that fills the whole area; it stays round whatever the aspect."""

    type: Literal["star"] = "star"
    spokes: Annotated[Whole, Field(ge=1, le=360)] = 36
    """Spokes of each colour."""


class Edge(_InTwoColours):
    """A straight slanted edge through the centre, as ISO 12233 measures sharpness with."""

    type: Literal["edge"] = "edge"
    angle_deg: Annotated[Real, Field(ge=-180, le=180)] = 5.0
    """Turns the edge clockwise from upright; at 0 the first colour is on the left."""


class Text(_InTwoColours):
    """One line of text in DejaVu Sans, as large as fits; the first colour on the second."""

    type: Literal["text"] = "text"
    text: Annotated[str, Field(min_length=1, max_length=64)]
    """1 to 64 printable Latin-1 characters."""

    @model_validator(mode="after")
    def _can_be_drawn(self) -> Self:
        for character in self.text:
            if not character.isprintable() or character > "ÿ":
                raise ValueError(f"text: {character!r} cannot be drawn; use printable Latin-1 characters")
        if not self.text.strip():
            raise ValueError("text: give at least one character that is no space")
        return self


class Noise(_Pattern):
    """Noise whose amplitude falls as frequency^-exponent, like that of natural scenes; it tiles."""

    type: Literal["noise"] = "noise"
    exponent: Annotated[Real, Field(ge=0, le=4)] = 1.0
    """Of the amplitude spectrum: 0 is white noise, 1 natural, 2 cloudy."""
    contrast: NonNegative = 0.3
    """Standard deviation of the linear reflectance over its mean, in each channel."""
    colour: Colour = (0.6, 0.6, 0.6)
    """Mean reflectance, sRGB."""
    chroma: Share = 0.0
    """Share of the variance that each channel has for itself: channels correlate with 1 - chroma."""
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = 0
    """Another number gives another pattern of the same kind."""

    @model_validator(mode="after")
    def _stays_physical(self) -> Self:
        most = _most_contrast(self.colour)
        if self.contrast > most:
            raise ValueError(
                f"contrast: {self.contrast:g} puts more than {CLIPPED_SHARE:.0%} of the values outside "
                f"0 to 1; use at most {math.floor(1000 * most) / 1000:g} with this colour"
            )
        return self


Texture = Annotated[Checks | Stripes | Star | Edge | Text | Noise, Field(discriminator="type")]


def _most_contrast(colour: tuple[float, float, float]) -> float:
    """The contrast at which `CLIPPED_SHARE` of normal values of one channel lie outside 0 to 1."""
    below, above = 0.0, 1.0
    means = srgb_to_linear(np.array(colour)).tolist()
    for _ in range(50):
        middle = (below + above) / 2
        if max(_share_outside(mean, middle) for mean in means) <= CLIPPED_SHARE:
            below = middle
        else:
            above = middle
    return below


def _share_outside(mean: float, contrast: float) -> float:
    """Of a normal distribution about `mean` with a deviation of `contrast` times that."""
    if mean == 0:
        return 0.0
    room = 1 / contrast, (1 - mean) / (mean * contrast)
    return sum(math.erfc(deviations / math.sqrt(2)) / 2 for deviations in room)

"""Options that several commands take: folders, depths, a light, methods."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import CoercionError, Parameter, Token

from pcii.base import Executor
from pcii.types import MOST_DEPTHS


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

"""Options that several commands take: folder of results, depths, a smaller photon budget."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import CoercionError, Parameter

from pcii.store.dataset import Dataset, budget_of, open_dataset
from pcii.types.arrays import MOST_DEPTHS

if TYPE_CHECKING:
    from cyclopts import Token


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
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise ValueError(
            f"expected a depth in mm such as 540, or start:stop:step such as 500:700:20, got {text!r}"
        )
    start, stop, step = numbers
    if step <= 0 or stop < start:
        raise ValueError(f"expected start:stop:step with start up to stop and a step above 0, got {text!r}")
    steps = (stop - start) / step
    if steps >= MOST_DEPTHS:
        raise ValueError(f"{text!r} are more than {MOST_DEPTHS} depths; take a larger step")
    # Steps such as 0.1 are not exact in binary; the stop counts as met within a millionth of a step.
    return [start + number * step for number in range(math.floor(steps + 1e-6) + 1)]


def _all_depths_mm(kind: Any, tokens: "Sequence[Token]") -> tuple[float, ...]:
    depths: list[float] = []
    for token in tokens:
        try:
            depths += depths_mm(token.value)
        except ValueError as fault:  # with the token, so that the option is named whichever value is wrong
            raise CoercionError(msg=str(fault), token=token) from None
    return tuple(depths)


def opened(dataset: Path, budget: str | None) -> Dataset:
    """The dataset with the photons of this budget, None: of its recipe's; or its radiance, at full light."""
    data = open_dataset(dataset)
    return data if budget is None else data.at_budget(budget_of(budget))


def budget_words(dataset: Dataset) -> list[str]:
    """The option that gives the budget at which a dataset is looked at."""
    budget = dataset.budget
    return [] if budget is None else ["--budget", budget if isinstance(budget, str) else f"{budget:g}"]


Out = Annotated[Path, Parameter(name=("--out", "-o"))]
Depths = Annotated[tuple[float, ...], Parameter(name="--z-mm", converter=_all_depths_mm)]
Budget = Annotated[
    str | None,
    Parameter(help="Use the photons of this smaller, nested budget, or full-light: the radiance alone."),
]
Json = Annotated[bool, Parameter(name="--json")]

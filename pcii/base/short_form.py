"""What values with large contents say of themselves: one line, and in notebooks a small table."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np

from pcii.base.plain_text import in_html, visible

LONGEST = 119
"""Characters of the line: it fits where one of code would."""
MOST = 4
"""Longer lists are abbreviated to their first and last value and their length."""


class Brief(ABC):
    """Gives a class that states its `_facts` a short `repr` and a table for notebooks."""

    @abstractmethod
    def _facts(self) -> Mapping[str, object]:
        """What distinguishes this value from others of its kind, by importance; None is left out."""

    def _known_facts(self) -> list[tuple[str, object]]:
        return [(name, fact) for name, fact in self._facts().items() if fact is not None]

    def __repr__(self) -> str:
        facts = ", ".join(f"{name}={visible(str(_figure(fact)))}" for name, fact in self._known_facts())
        line = f"{type(self).__name__}({facts})"
        return line if len(line) <= LONGEST else f"{line[: LONGEST - 2]}…)"

    def _repr_html_(self) -> str:
        return table(type(self).__name__, self._known_facts())


def table(caption: str, rows: Sequence[Sequence[object]], header: Sequence[str] = ()) -> str:
    """A table in HTML, whatever its cells say; four digits of numbers, a dash for None."""
    names = "".join(f"<th>{in_html(name)}</th>" for name in header)
    body = "".join(
        f"<tr>{''.join(f'<td>{in_html(_figure(cell))}</td>' for cell in row)}</tr>" for row in rows
    )
    return f"<table><caption>{in_html(caption)}</caption><tr>{names}</tr>{body}</table>"


def _figure(value: object) -> object:
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else value


def times(shape: Sequence[int]) -> str:
    """A shape such as 10 x 10 x 64 x 64."""
    return " x ".join(map(str, shape))


def span(values: np.ndarray) -> str | None:
    """From the least value to the greatest; None for none."""
    return f"{values.min():g} to {values.max():g}" if values.size else None


def listed(values: Sequence[object]) -> str:
    """A list such as [540, 620], or [450 .. 750: 30 in all] for a long one."""
    told = [f"{value:g}" if isinstance(value, float) else str(value) for value in values]
    if len(told) <= MOST:
        return f"[{', '.join(told)}]"
    return f"[{told[0]} .. {told[-1]}: {len(told)} in all]"

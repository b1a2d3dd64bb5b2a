"""Short representations of objects that hold large arrays: one line; in notebooks a table and pictures."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np

from pcii.base.plain_text import in_html, visible

LONGEST = 119
"""Most characters of the line."""
MOST = 4
"""Longer lists are abbreviated to their first and last value and their length."""


class ShortForm(ABC):
    """Gives a class that states its `_facts` a short `repr` and a table for notebooks."""

    @abstractmethod
    def _facts(self) -> Mapping[str, object]:
        """Names and values of what distinguishes this object, most important first; None is left out."""

    def _known_facts(self) -> list[tuple[str, object]]:
        return [(name, fact) for name, fact in self._facts().items() if fact is not None]

    def __repr__(self) -> str:
        facts = ", ".join(f"{name}={visible(str(_figure(fact)))}" for name, fact in self._known_facts())
        line = f"{type(self).__name__}({facts})"
        return line if len(line) <= LONGEST else f"{line[: LONGEST - 2]}…)"

    def _thumbnails(self) -> Mapping[str, str]:
        """Small pictures for notebooks: data URIs by caption."""
        return {}

    def _repr_html_(self) -> str:
        return table(type(self).__name__, self._known_facts()) + side_by_side(self._thumbnails())


def table(caption: str, rows: Sequence[Sequence[object]], header: Sequence[str] = ()) -> str:
    """A table in HTML with escaped cells; four significant digits of numbers, a dash for None."""
    names = "".join(f"<th>{in_html(name)}</th>" for name in header)
    body = "".join(
        f"<tr>{''.join(f'<td>{in_html(_figure(cell))}</td>' for cell in row)}</tr>" for row in rows
    )
    return f"<table><caption>{in_html(caption)}</caption><tr>{names}</tr>{body}</table>"


def side_by_side(uris: Mapping[str, str]) -> str:
    """Pictures side by side in HTML, each with its caption; nothing if there are none."""
    cells = "".join(
        f'<td><img src="{in_html(uri)}" alt="{in_html(caption)}"><br>{in_html(caption)}</td>'
        for caption, uri in uris.items()
    )
    return f"<table><tr>{cells}</tr></table>" if uris else ""


def _figure(value: object) -> object:
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else value


def times(shape: Sequence[int]) -> str:
    """A shape as text.

    >>> times((10, 10, 64, 64))
    '10 x 10 x 64 x 64'
    """
    return " x ".join(map(str, shape))


def span(values: np.ndarray) -> str | None:
    """The range of the values as text; None for an empty array.

    >>> span(np.array([620.0, 540.0, 580.0]))
    '540 to 620'
    """
    return f"{values.min():g} to {values.max():g}" if values.size else None


def listed(values: Sequence[object]) -> str:
    """A list as text, abbreviated if it has more than four values.

    >>> listed([540.0, 620.0]), listed(range(30))
    ('[540, 620]', '[0 .. 29: 30 in all]')
    """
    texts = [f"{value:g}" if isinstance(value, float) else str(value) for value in values]
    if len(texts) <= MOST:
        return f"[{', '.join(texts)}]"
    return f"[{texts[0]} .. {texts[-1]}: {len(texts)} in all]"

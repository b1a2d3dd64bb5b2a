"""Short representations of objects that hold large arrays, in one line."""

from collections.abc import Mapping, Sequence

import numpy as np

from pcii.base.plain_text import visible

MAX_LINE_LENGTH = 119
MAX_LISTED = 4
"""Longer lists are abbreviated to their first and last value and their length."""


class ShortForm:
    """Gives a dataclass a short `repr`."""

    def _facts(self) -> Mapping[str, object]:
        """Names and values of what distinguishes this object, most important first; None is left out."""
        return vars(self)

    def __repr__(self) -> str:
        known = {name: _figure(fact) for name, fact in self._facts().items() if fact is not None}
        facts = ", ".join(f"{name}={visible(str(fact))}" for name, fact in known.items())
        line = f"{type(self).__name__}({facts})"
        return line if len(line) <= MAX_LINE_LENGTH else f"{line[: MAX_LINE_LENGTH - 2]}…)"


def _figure(value: object) -> object:
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
    if len(texts) <= MAX_LISTED:
        return f"[{', '.join(texts)}]"
    return f"[{texts[0]} .. {texts[-1]}: {len(texts)} in all]"

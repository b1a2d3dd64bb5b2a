"""Short representations of objects that hold large arrays: one line; in notebooks a table and a picture."""

import base64
import io
from collections.abc import Mapping, Sequence

import numpy as np

from pcii.base.errors import InputError
from pcii.base.plain_text import in_html, visible

MAX_LINE_LENGTH = 119
MAX_LISTED = 4
"""Longer lists are abbreviated to their first and last value and their length."""
PICTURE_DOTS_PER_INCH = 60


class ShortForm:
    """Gives a dataclass a short `repr`, and a table and its `plot` to notebooks."""

    def _facts(self) -> Mapping[str, object]:
        """Names and values of what distinguishes this object, most important first; None is left out."""
        return vars(self)

    def __repr__(self) -> str:
        facts = ", ".join(f"{name}={visible(text)}" for name, text in _texts(self._facts()).items())
        line = f"{type(self).__name__}({facts})"
        return line if len(line) <= MAX_LINE_LENGTH else f"{line[: MAX_LINE_LENGTH - 2]}…)"

    def _repr_html_(self) -> str:
        facts = _texts(self._facts()).items()
        rows = "".join(f"<tr><td>{in_html(name)}</td><td>{in_html(text)}</td></tr>" for name, text in facts)
        table = f"<table><caption>{type(self).__name__}</caption>{rows}</table>"
        if not hasattr(self, "plot"):
            return table
        from matplotlib import pyplot

        try:
            figure = self.plot()[0].figure  # type: ignore[attr-defined]
        except (InputError, OSError):  # of data that cannot be read
            return table
        png = io.BytesIO()
        figure.savefig(png, format="png", dpi=PICTURE_DOTS_PER_INCH)
        pyplot.close(figure)
        return f'{table}<img src="data:image/png;base64,{base64.b64encode(png.getvalue()).decode()}">'


def _texts(facts: Mapping[str, object]) -> dict[str, str]:
    return {
        name: f"{fact:.4g}" if isinstance(fact, float) else str(fact)
        for name, fact in facts.items()
        if fact is not None
    }


def times(shape: Sequence[int]) -> str:
    """A shape as text.

    >>> times((10, 10, 64, 64))
    '10 x 10 x 64 x 64'
    """
    return " x ".join(map(str, shape))


def span(values: np.ndarray) -> str | None:
    """The range of the values as text; None for an empty array."""
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

"""Text that people read: errors, short forms of values, and text from untrusted files, escaped."""

import re
import unicodedata
from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

UNSEEN = re.compile(
    "[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)
"""Control characters, ends of lines, marks of writing direction, surrogates, and what is no character."""
BLANK = re.compile("[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u2800\ufe00-\ufe0f\U000e0100-\U000e01ef]")
"""Letters, marks and symbols of Unicode that are drawn as nothing, or choose how the one before is drawn."""
MARKDOWN = re.compile(r"[\\`*\[\]|~$#]|(?<![^\W_])_|_(?![^\W_])")
"""Characters with a meaning in Markdown; an underscore has one only at the ends of words."""
MAX_LINE_LENGTH = 119
MAX_LISTED = 4
"""Longer lists are abbreviated to their first and last value and their length."""


class InputError(ValueError):
    """Invalid input, described in one sentence that names the argument, field or file and what is expected.

    Where a file has several faults the sentence is of the first, and notes (`add_note`) name the others. The
    commands print both and exit with code 2.
    """


class WorkerLostError(RuntimeError):
    """A process that did a part of the work has died, or a cluster is out of reach."""


class ShortForm:
    """Gives a dataclass a short `repr`."""

    def _facts(self) -> Mapping[str, object]:
        """Names and values of what distinguishes this object, most important first; None is left out."""
        return vars(self)

    def __repr__(self) -> str:
        known = {name: fact for name, fact in self._facts().items() if fact is not None}
        texts = {n: f"{fact:.4g}" if isinstance(fact, float) else str(fact) for n, fact in known.items()}
        facts = ", ".join(f"{name}={visible(text)}" for name, text in texts.items())
        line = f"{type(self).__name__}({facts})"
        return line if len(line) <= MAX_LINE_LENGTH else f"{line[: MAX_LINE_LENGTH - 2]}…)"


def times(shape: Sequence[int]) -> str:
    """A shape as text, such as "10 x 10 x 64 x 64"."""
    return " x ".join(map(str, shape))


def span(values: np.ndarray) -> str | None:
    """The range of the values as text, such as "540 to 620"; None for an empty array."""
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


def visible(text: str) -> str:
    """The text on one line, with characters that cannot be seen or written as escape sequences.

    >>> visible("two" + chr(10) + "lines")
    'two\\\\nlines'
    """
    return UNSEEN.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def is_plain(text: str) -> bool:
    """Whether all of a text is seen: printable characters, single blanks, and the NFKC form of Unicode.

    >>> is_plain("Größe 2"), is_plain("two  blanks"), is_plain("\uff4dine"), is_plain("mi\u200bne")
    (True, False, False, False)
    """
    in_normal_form = " ".join(unicodedata.normalize("NFKC", text).split())
    return text == in_normal_form and text.isprintable() and not BLANK.search(text)


def in_markdown(text: str) -> str:
    """The text, escaped so that Markdown shows it literally, in tables too.

    >>> print(in_markdown("a|b, snake_case, *c*"))
    a\\|b, snake_case, \\*c\\*
    """
    return MARKDOWN.sub(r"\\\g<0>", escape(visible(text), quote=False))

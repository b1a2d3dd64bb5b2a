"""Display of text from untrusted files: markup is escaped, invisible characters are made visible."""

import re
from html import escape

UNSEEN = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters, ends of lines, marks of writing direction, and surrogates."""
MARKDOWN = re.compile(r"[\\`*\[\]|~$#]|(?<![^\W_])_|_(?![^\W_])")
"""Characters with a meaning in Markdown; an underscore has one only at the ends of words."""


def visible(text: str) -> str:
    """The text on one line, with characters that cannot be seen or written as escape sequences.

    >>> visible("two" + chr(10) + "lines")
    'two\\\\nlines'
    """
    return UNSEEN.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def in_html(value: object) -> str:
    """The text of a value, escaped for the content or a quoted attribute of an HTML element.

    >>> in_html("<b>")
    '&lt;b&gt;'
    """
    return escape(visible(str(value)))


def in_markdown(text: str) -> str:
    """The text, escaped so that Markdown shows it literally, in tables too.

    >>> print(in_markdown("a|b, snake_case, *c*"))
    a\\|b, snake_case, \\*c\\*
    """
    return MARKDOWN.sub(r"\\\g<0>", escape(visible(text), quote=False))

"""Names that others chose, shown as text: nothing in them is carried out, and nothing is hidden."""

import re
from html import escape

UNSEEN = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters, ends of lines, what turns the direction of writing, and halves of characters."""
MARKDOWN = re.compile(r"[\\`*\[\]|~$#]|(?<![^\W_])_|_(?![^\W_])")
"""What means something in Markdown; an underscore does so at the ends of words alone."""


def visible(text: str) -> str:
    """The text on one line, characters that cannot be seen or written as their escapes, such as \\u202e."""
    return UNSEEN.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def in_html(value: object) -> str:
    """A value as text of a page or of an attribute in quotes."""
    return escape(visible(str(value)))


def in_markdown(text: str) -> str:
    """The text so that Markdown shows it as it is, in tables too."""
    return MARKDOWN.sub(r"\\\g<0>", escape(visible(text), quote=False))

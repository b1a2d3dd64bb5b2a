"""Display of text from untrusted files: markup is escaped, invisible characters are made visible."""

import re
from html import escape
from urllib.parse import quote

UNSEEN = re.compile(
    "[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)
"""Control characters, ends of lines, marks of writing direction, surrogates, and what is no character."""
MARKDOWN = re.compile(r"[\\`*\[\]|~$#]|(?<![^\W_])_|_(?![^\W_])")
"""Characters with a meaning in Markdown; an underscore has one only at the ends of words."""
OF_ADDRESSES = "%/:?#[]@!$&'()*+,;=~"
"""What addresses of the web hold beside letters, digits and - . _ as it is."""


def visible(text: str) -> str:
    """The text on one line, with characters that cannot be seen or written as escape sequences.

    >>> visible("two" + chr(10) + "lines")
    'two\\\\nlines'
    """
    return UNSEEN.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def in_terminal(text: str) -> str:
    """The lines of a text, with what a terminal would obey and not show as escape sequences.

    >>> print(in_terminal("two" + chr(10) + "lines" + chr(27) + "[2J"))
    two
    lines\\x1b[2J
    """
    return "\n".join(map(visible, text.split("\n")))


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


def web_address(text: str) -> str:
    """An address of the web as a link takes it, other characters percent-encoded; "" for any other text.

    >>> web_address("https://example.org/a b"), web_address("javascript://x")
    ('https://example.org/a%20b', '')
    """
    if not re.match("https?://", text, re.IGNORECASE):
        return ""
    return quote(text, safe=OF_ADDRESSES, errors="backslashreplace")

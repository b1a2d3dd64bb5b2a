"""Text from untrusted files: whether all of it is seen; markup escaped, invisible characters made visible."""

import re
import unicodedata
from html import escape
from urllib.parse import quote

UNSEEN = re.compile(
    "[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)
"""Control characters, ends of lines, marks of writing direction, surrogates, and what is no character."""
BLANK = re.compile("[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u2800\ufe00-\ufe0f\U000e0100-\U000e01ef]")
"""Letters, marks and symbols of Unicode that are drawn as nothing, or choose how the one before is drawn."""
WORD = re.compile(r"[^\x00-/:-@\[-`{-\x7f]+")
"""Characters between blanks and ASCII punctuation."""
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


def is_plain(text: str) -> bool:
    """Whether all of a text is seen: printable characters, single blanks, and the NFKC form of Unicode.

    >>> is_plain("Größe 2"), is_plain("two  blanks"), is_plain("\uff4dine"), is_plain("mi\u200bne")
    (True, False, False, False)
    """
    in_normal_form = " ".join(unicodedata.normalize("NFKC", text).split())
    return text == in_normal_form and text.isprintable() and not BLANK.search(text)


def is_plain_name(text: str) -> bool:
    """Whether a text `is_plain`, of letters, digits and ASCII punctuation, and no word mixes alphabets.

    Such a word has Latin letters beside others, which may look like them.

    >>> is_plain_name("β-net 2"), is_plain_name("n\u0435t"), is_plain_name("β\u2010net")
    (True, False, False)
    """
    is_known = all(letter.isascii() or unicodedata.category(letter)[0] in "LMN" for letter in text)
    return is_plain(text) and is_known and not any(map(_mixes_alphabets, WORD.findall(text)))


def _mixes_alphabets(word: str) -> bool:
    letters = re.sub("[0-9]", "", word)
    alphabets = {unicodedata.name(letter, "").partition(" ")[0] for letter in letters}
    return "LATIN" in alphabets and len(alphabets) > 1


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

"""Pages of HTML from the templates of this room, and tables of text for them.

A table is a data frame of texts, and its index names the rows: the levels of the index are the first columns,
aligned to the left. A page fetches nothing and runs nothing, or the one script that comes with its template,
which its policy names by hash.
"""

import base64
import hashlib
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pcii.base import visible

if TYPE_CHECKING:
    from markupsafe import Markup
    from pandas import DataFrame

NOT_KNOWN = "–"
"""Stands in tables for a number that is not known."""


def render_page(template: str, content: Mapping[str, Any], *, script: str | None = None) -> bytes:
    """A page in UTF-8 from a template of this room.

    All content is escaped as text; it is an error if it lacks a name. `script` is a file beside the template,
    and the only script that browsers run in the page: no content can be one. In templates the filter `table`
    is `table_html`.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    def as_visible_text(value: object) -> object:
        return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value

    loader = PackageLoader("pcii.figures")
    environment = Environment(
        loader=loader,
        autoescape=True,
        undefined=StrictUndefined,
        finalize=as_visible_text,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["table"] = table_html
    code = "" if script is None else loader.get_source(environment, script)[0]
    digest = base64.b64encode(hashlib.sha256(code.encode()).digest()).decode("ascii")
    of_script = {"script": Markup(code), "script_hash": Markup(f"'sha256-{digest}'")}
    return environment.get_template(template).render(content, **of_script).encode()


def text_table(rows: Iterable[Sequence[str]], header: Sequence[str], words: int = 1) -> "DataFrame":
    """A table of texts with the columns `header`, of which the first `words` name the rows."""
    import pandas as pd

    return pd.DataFrame([*rows], columns=[*header], dtype=object).set_index([*header[:words]])


def emphasised(text: str) -> "Markup":
    """A text that stands out in `table_html`."""
    from markupsafe import Markup

    return Markup("<strong>{}</strong>").format(text)


def table_html(table: "DataFrame", title: str, css_class: str = "") -> "Markup":
    """A table in HTML, in a region that scrolls by itself if it is too wide; all texts are escaped."""
    from markupsafe import Markup, escape

    def as_visible_html(text: str) -> str:
        return visible(escape(text))

    cells = table.reset_index().rename(columns=as_visible_html).map(as_visible_html)
    row_names = cells.columns[0]
    style = cells.set_index(row_names).rename_axis(index=None, columns=row_names).style
    classes = f"wide words-{table.index.nlevels} {css_class}"
    region = Markup('<div class="{}" tabindex="0" role="region" aria-label="{}">\n{}</div>')
    return region.format(classes.strip(), visible(title), Markup(style.to_html(exclude_styles=True)))

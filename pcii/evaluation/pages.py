"""HTML pages made from templates: content is escaped as text, and pages fetch nothing.

A page runs nothing, or the one script that comes with its template, which its policy names by hash.
"""

import base64
import hashlib
from typing import Any

from pcii.base.plain_text import visible


def page(template: str, content: dict[str, Any], script: str | None = None) -> bytes:
    """A page in UTF-8 from a file in `templates`; it is an error if `content` lacks a name.

    `script` is a file there, and the only script that browsers run in the page: no content can be one.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    def as_visible_text(value: object) -> object:
        return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value

    loader = PackageLoader("pcii.evaluation")
    environment = Environment(
        loader=loader,
        autoescape=True,
        undefined=StrictUndefined,
        finalize=as_visible_text,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    own: dict[str, Any] = {"script": None}
    if script is not None:
        text = loader.get_source(environment, script)[0]
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
        own = {"script": Markup(text), "script_hash": Markup(f"'sha256-{digest}'")}
    return environment.get_template(template).render(content, **own).encode()

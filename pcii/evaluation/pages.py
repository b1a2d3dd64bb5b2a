"""HTML pages made from templates: content is escaped as text, and pages run and fetch nothing."""

from typing import Any

from pcii.base.plain_text import visible


def page(template: str, content: dict[str, Any]) -> bytes:
    """A page in UTF-8 from a file in `templates`; it is an error if `content` lacks a name."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    def as_visible_text(value: object) -> object:
        return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value

    environment = Environment(
        loader=PackageLoader("pcii.evaluation"),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=as_visible_text,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = _number
    return environment.get_template(template).render(content).encode()


def _number(value: float | None, digits: int = 3) -> str:
    return "–" if value is None else f"{value:.{digits}f}"

"""Pages made from templates: all that is put in is text, and no page runs or fetches anything."""

from typing import Any

from pcii.base.plain_text import visible


def page(template: str, content: dict[str, Any]) -> bytes:
    """A page of `templates` with this content, in UTF-8; a name that the content lacks is an error."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    def shown(value: object) -> object:
        return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value

    environment = Environment(
        loader=PackageLoader("pcii.evaluation"),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=shown,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = _number
    return environment.get_template(template).render(content).encode()


def _number(value: float | None, digits: int = 3) -> str:
    return "–" if value is None else f"{value:.{digits}f}"

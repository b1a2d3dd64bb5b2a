"""How Sphinx builds the pages of this folder: `make docs`."""

from dataclasses import fields, is_dataclass
from inspect import Signature, signature
from typing import Any

from docutils import nodes
from pydantic import BaseModel

import pcii
import simgen

project = "Photon-starved integral imaging"
author = copyright = "The photon-integral-imaging authors"
version = release = pcii.__version__

RULES = "Annotated[", "custom_error"
"""What stands in the types of fields that have rules of what is valid."""

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary"]
templates_path = ["_templates"]  # of the pages of the reference, a name each, which go to the folder api
highlight_language = "none"  # of blocks that name no language
exclude_patterns = ["gallery/*"]  # pictures

myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]  # GitHub's way to write a displayed equation
myst_heading_anchors = 4  # links to headings as GitHub makes them: page.md#some-heading

default_role = "literal"  # docstrings write names in single backticks
# Fields of dataclasses: the text of the class explains them, so that the table above it has the others alone.
autosummary_context = {
    "fields": {
        name: [field.name for field in fields(kind)]
        for module in (pcii, simgen)
        for name, kind in ((name, getattr(module, name)) for name in module.__all__)
        if is_dataclass(kind)
    }
}
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88

html_theme = "furo"
html_title = f"{project} {version}"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
html_math_renderer = "mathml"
html_theme_options = {"navigation_with_keys": True}


def setup(app: Any) -> None:
    """Have equations written as MathML, which browsers show without a script and without the network.

    Of the models of scenes and recipes only names and defaults are shown: their types hold all the rules of
    what is valid, which the texts of the fields say in words.
    """
    app.connect("autodoc-process-signature", _names_and_defaults)
    app.connect("autodoc-skip-member", lambda app, what, name, *_: name.startswith("model_") or None)
    app.connect("object-description-transform", _leave_out_rules)
    app.add_html_math_renderer("mathml", (_inline_equation, None), (_displayed_equation, None))


def _names_and_defaults(app: Any, what: str, name: str, kind: Any, *_: Any) -> tuple[str, None] | None:
    if not (isinstance(kind, type) and issubclass(kind, BaseModel)):
        return None
    parameters = [one.replace(annotation=one.empty) for one in signature(kind).parameters.values()]
    return str(Signature(parameters)), None


def _leave_out_rules(app: Any, domain: str, what: str, content: nodes.Element) -> None:
    if what == "attribute" and content.parent is not None:
        for node in list(content.parent.findall(nodes.Element)):
            if node.tagname == "desc_annotation" and any(word in node.astext() for word in RULES):
                node.parent.remove(node)


def _inline_equation(translator: Any, node: nodes.math) -> None:
    translator.body.append(_mathml(node.astext(), displayed=False))
    raise nodes.SkipNode


def _displayed_equation(translator: Any, node: nodes.math_block) -> None:
    translator.body.append(f'<div class="equation">{_mathml(node.astext(), displayed=True)}</div>\n')
    raise nodes.SkipNode


def _mathml(latex: str, *, displayed: bool) -> str:
    """MathML of an equation; what cannot be converted stops the build."""
    from math_core import LatexToMathML  # pyright: ignore[reportMissingImports]

    return LatexToMathML().convert_with_local_state(latex, displaystyle=displayed)

"""Colours and markers that the colour-blind can distinguish, and names as Matplotlib shows them."""

from pcii.base.plain_text import visible

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""The palette of Okabe and Ito, which the colour-blind can distinguish."""
MARKERS = "osD^vPX"
LONGEST_NAME = 40
"""Characters of a name, about a third of a plot's width."""


def plot_label(name: str) -> str:
    """A name as text for Matplotlib: at most `LONGEST_NAME` characters, none read as mathematics.

    >>> print(plot_label("_a$b"))
    a\\$b
    """
    name = visible(name)
    name = name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1]}…"
    return name.lstrip("_").replace("$", r"\$")

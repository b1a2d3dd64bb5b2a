"""Packages that rendering alone needs, and the sentence for where they are missing."""

import importlib.util
from collections.abc import Sequence

from pcii.base import InputError

MODULES = {"mitsuba": "mitsuba", "drjit": "drjit", "colour": "colour-science", "plyfile": "plyfile"}
"""The modules of the extra `render`, and the packages that they are of."""


def check_installed() -> None:
    """Raise `InputError` unless all of them are installed."""
    missing = [package for module, package in MODULES.items() if importlib.util.find_spec(module) is None]
    if missing:
        raise not_installed(missing)


def not_installed(names: Sequence[str]) -> InputError:
    """That packages are missing, and what to type."""
    return InputError(
        f"{' and '.join(names)}: not installed, and needed for rendering; type in the source tree:  "
        "pip install '.[render]'"
    )

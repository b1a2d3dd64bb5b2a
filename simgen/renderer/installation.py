"""Whether the renderer is installed, which analysis does without."""

import importlib.util

from pcii.base.errors import InputError

NEEDED = ("mitsuba", "drjit")


def check_installed() -> None:
    """Raise `InputError`, with what to type, unless Mitsuba and Dr.Jit are installed."""
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(
            f"{' and '.join(missing)}: not installed, and needed for rendering; type in the source tree:  "
            "pip install '.[render]'"
        )

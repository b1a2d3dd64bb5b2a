"""The sentence for packages that rendering alone needs, where they are missing."""

from collections.abc import Sequence

from pcii.base.errors import InputError


def not_installed(names: Sequence[str]) -> InputError:
    """That packages of the extra `render` are missing, and what to type."""
    return InputError(
        f"{' and '.join(names)}: not installed, and needed for rendering; type in the source tree:  "
        "pip install '.[render]'"
    )

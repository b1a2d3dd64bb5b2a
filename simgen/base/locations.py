"""Where scenes and recipes are found: the working directory, the source tree, the installed package."""

from collections.abc import Callable
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def _roots(name: str) -> list[Path]:
    candidates = (Path.cwd() / name, _PACKAGE.parent / name, _PACKAGE / "_shipped" / name)
    roots: list[Path] = []
    for root in candidates:
        if root.is_dir() and root.resolve() not in (known.resolve() for known in roots):
            roots.append(root)
    return roots


def scene_roots() -> list[Path]:
    """Folders that hold scene folders."""
    return _roots("scenes")


def recipe_roots() -> list[Path]:
    """Folders that hold recipe files."""
    return _roots("data_recipes")


def find(roots: Callable[[], list[Path]], name: str) -> Path | None:
    """The first file of that name under any of the roots."""
    return next((root / name for root in roots() if (root / name).is_file()), None)

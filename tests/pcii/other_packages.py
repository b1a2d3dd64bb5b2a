"""Packages with methods of their own, as if installed: modules and entry points in a folder of the path."""

import sys
from collections.abc import Mapping
from pathlib import Path

import pytest


def install_package(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    points: Mapping[str, Mapping[str, str]],
    files: Mapping[str, str],
    *,
    version: str = "1.0",
    requires: str = "",
) -> None:
    """Put a package `strange` with these entry points by group and these files into a folder of the path.

    Again, it takes the place of what was there, and its modules are loaded anew.
    """
    about = folder / "strange.dist-info"
    about.mkdir(exist_ok=True)
    needs = f"Requires-Dist: {requires}\n" if requires else ""
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: strange\nVersion: {version}\n{needs}")
    groups = (
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in values.items())
        for group, values in points.items()
    )
    (about / "entry_points.txt").write_text("\n".join(groups))
    for name, content in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(content)
        monkeypatch.delitem(sys.modules, name.removesuffix("/__init__.py").removesuffix(".py"), raising=False)
    monkeypatch.syspath_prepend(str(folder))

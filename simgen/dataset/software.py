"""The software that a dataset is made with: other versions may give other bytes."""

from collections.abc import Mapping
from importlib.metadata import version

DECISIVE = ("photon-integral-imaging", "mitsuba")
"""Packages whose versions are part of what identifies a dataset."""


def versions() -> dict[str, str]:
    """Versions of the packages that make datasets."""
    return {name: version(name) for name in (*DECISIVE, "drjit", "numpy", "zarr")}


def decisive_versions() -> dict[str, str]:
    """Versions that identify a dataset, with its recipe and scene."""
    return {name: version(name) for name in DECISIVE}


def other_versions(recorded: Mapping[str, str]) -> str:
    """The decisive versions recorded and those here, as part of a sentence; empty if they are the same."""
    here = decisive_versions()
    before = {name: recorded.get(name, "of unknown version") for name in DECISIVE}
    if before == here:
        return ""
    return f"{_listed(before)}, and here is {_listed(here)}, whose photons may differ"


def _listed(packages: Mapping[str, str]) -> str:
    return " with ".join(f"{name} {number}" for name, number in packages.items())

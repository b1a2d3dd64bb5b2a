"""The software that a dataset is made with: other versions may give other bytes."""

from collections.abc import Mapping

from pcii.store import software
from pcii.store.software import PACKAGE

DECISIVE = (PACKAGE, "mitsuba")
"""Packages whose versions are part of what identifies a dataset."""


def versions() -> dict[str, str]:
    """Versions of the packages that make datasets."""
    return software.versions(*DECISIVE, "drjit", "numpy", "zarr")


def decisive_versions() -> dict[str, str]:
    """Versions that identify a dataset, with its recipe and scene."""
    return software.versions(*DECISIVE)


def other_versions(recorded: Mapping[str, str]) -> str:
    """How the decisive versions recorded differ from those here, in words; empty if they are the same."""
    known = {name: number for name, number in recorded.items() if name in DECISIVE}
    return software.differences(known, decisive_versions())

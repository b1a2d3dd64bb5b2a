"""The long steps of an analysis; what an earlier run did is kept if nothing that it follows from has changed.

A result follows from the dataset's files, the photon budget, the step with its options, and the software: the
source of this package and the versions of those that compute for it. Methods of other packages are always run
again, since nothing here knows what theirs follow from.
"""

import hashlib
import json
import sys
import time
from collections.abc import Callable, Collection
from functools import cache
from importlib.metadata import version
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar

import pcii.base
from pcii.app.results import Making, Results
from pcii.core.estimates import DepthMap, Segmented
from pcii.core.section_stack import Sections
from pcii.removal.methods import METHODS

COMPUTING = ("numpy", "scipy", "numba", "scikit-image")
"""Other packages whose version may change a result."""
DEPTH_STEP = "depth"
Made = TypeVar("Made")


def removal_step(method: str) -> str:
    """What the step of a method of removal is called."""
    return f"removal, {method}"


class Steps:
    """Does the long steps of an analysis: each call returns what `make` makes and how long it took, in s."""

    def removal(
        self, method: str, sections: Sections, make: Callable[[], Segmented]
    ) -> tuple[Segmented, float]:
        """Masks of the sections by a method."""
        return timed(make)

    def depth(self, z_range_mm: tuple[float, float], make: Callable[[], DepthMap]) -> tuple[DepthMap, float]:
        """A depth map within a range, by the default method."""
        return timed(make)

    def kept(self) -> Collection[str]:
        """Names of the steps that were done before, as in `Outcome.timings_s`."""
        return ()


ALL_STEPS = Steps()
"""Does every step anew."""


def timed(make: Callable[[], Made]) -> tuple[Made, float]:
    """What `make` returns, and how long it took, in s."""
    start = time.perf_counter()
    made = make()
    return made, time.perf_counter() - start


class KeptSteps(Steps):
    """Does the steps whose results a folder does not hold already, and saves each there when it is done."""

    def __init__(self, results: Results) -> None:
        self._results = results
        self._kept: list[str] = []
        self._folder = Lock()  # steps run side by side, and one at a time looks into the folder or writes

    def kept(self) -> Collection[str]:
        """Names of the steps that were done before."""
        return self._kept

    def removal(
        self, method: str, sections: Sections, make: Callable[[], Segmented]
    ) -> tuple[Segmented, float]:
        """Masks of the sections by a method, from the folder if it has them."""
        step = removal_step(method)
        key = self._key({"step": step, "z_mm": sections.z_mm.tolist()})
        with self._folder:
            found = self._results.kept_masks(method, sections, key) if method in METHODS else None
        if found is not None:
            self._kept.append(step)
            return found
        focus, seconds = super().removal(method, sections, make)
        with self._folder, self._results.writing() as results:
            results.save_segmented(focus, Making(key, seconds) if method in METHODS else None)
        return focus, seconds

    def depth(self, z_range_mm: tuple[float, float], make: Callable[[], DepthMap]) -> tuple[DepthMap, float]:
        """A depth map within a range, from the folder if it has it."""
        key = self._key({"step": DEPTH_STEP, "z_range_mm": list(z_range_mm)})
        with self._folder:
            found = self._results.kept_depth(key)
        if found is not None:
            self._kept.append(DEPTH_STEP)
            return found
        depth, seconds = super().depth(z_range_mm, make)
        with self._folder, self._results.writing() as results:
            results.save_depth(depth, Making(key, seconds))
        return depth, seconds

    def _key(self, step: dict[str, Any]) -> str:
        """Hash of all that the result of a step follows from."""
        data = self._results.dataset
        seen = {name: data.manifest[name] for name in ("files", "grid", "cfa")}
        content = {"dataset": seen, "budget": data.budget, "software": _software(), **step}
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


@cache
def _software() -> dict[str, str]:
    """Versions of what computes, and a hash of the source of this package."""
    package = Path(pcii.base.__file__).parents[1]
    source = hashlib.sha256()
    for file in sorted(package.rglob("*.py")):
        source.update(f"{file.relative_to(package)}\0".encode() + file.read_bytes() + b"\0")
    versions = {name: version(name) for name in COMPUTING}
    return {"pcii": source.hexdigest(), "python": sys.version.split()[0], **versions}

"""The long steps of an analysis; what an earlier run did is kept if nothing that it follows from has changed.

A result follows from the dataset's files, the photon budget, the step with its options, and the software of
its method (see `pcii.evaluation.provenance`).
"""

import time
from collections.abc import Callable, Collection
from dataclasses import asdict
from threading import Lock
from typing import Any, TypeVar

from pcii.app.results import DEPTH, REPORT, SCORE, SECTIONS, Results, StepRecord, masks_name
from pcii.evaluation.method_names import depth_name
from pcii.evaluation.provenance import software_of
from pcii.store.folders import hash_json
from pcii.types.estimates import DepthMap, Segmented
from pcii.types.section_stack import Sections

DEPTH_STEP = "depth"
Made = TypeVar("Made")


def removal_step(method: str) -> str:
    """What the step of a method of removal is called."""
    return f"removal, {method}"


class Steps:
    """Does the long steps of an analysis: each call returns what `make` makes and how long it took, in s."""

    def begin(self, methods: Collection[str]) -> None:
        """What will be made is known, and about to be: masks by these methods, and all that follows."""

    def removal(
        self, method: str, sections: Sections, make: Callable[[], Segmented]
    ) -> tuple[Segmented, float]:
        """Masks of the sections by a method."""
        return timed(make)

    def depth(
        self, method: str, z_range_mm: tuple[float, float], make: Callable[[], DepthMap]
    ) -> tuple[DepthMap, float]:
        """A depth map within a range by a method."""
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

    def begin(self, methods: Collection[str]) -> None:
        """Note in the folder what the run will make of it."""
        with self._results.writing() as results:
            results.begin([*map(masks_name, methods), DEPTH, SECTIONS, SCORE, REPORT])

    def removal(
        self, method: str, sections: Sections, make: Callable[[], Segmented]
    ) -> tuple[Segmented, float]:
        """Masks of the sections by a method, from the folder if it has them."""
        step = removal_step(method)
        key = self._key(method, {"step": step, "z_mm": sections.z_mm.tolist()})
        with self._folder:
            found = self._results.kept_masks(method, sections, key)
            self._keep(masks_name(method), found)
        if found is not None:
            self._kept.append(step)
            return found
        focus, seconds = super().removal(method, sections, make)
        with self._folder, self._results.writing() as results:
            results.save_segmented(focus, StepRecord(key, seconds))
        return focus, seconds

    def depth(
        self, method: str, z_range_mm: tuple[float, float], make: Callable[[], DepthMap]
    ) -> tuple[DepthMap, float]:
        """A depth map within a range by a method, from the folder if it has it."""
        name = depth_name(method)
        key = self._key(name, {"step": DEPTH_STEP, "method": name, "z_range_mm": list(z_range_mm)})
        with self._folder:
            found = self._results.kept_depth(key)
            self._keep(DEPTH, found)
        if found is not None:
            self._kept.append(DEPTH_STEP)
            return found
        depth, seconds = super().depth(method, z_range_mm, make)
        with self._folder, self._results.writing() as results:
            results.save_depth(depth, StepRecord(key, seconds))
        return depth, seconds

    def _keep(self, name: str, found: object) -> None:
        if found is not None:
            with self._results.writing() as results:
                results.keep(name)

    def _key(self, method: str, step: dict[str, Any]) -> str:
        """Hash of all that the result of a method's step follows from."""
        data = self._results.dataset
        seen = {"files": data.manifest.files, "grid": asdict(data.grid), "cfa": data.cfa}
        content = {"dataset": seen, "budget": data.budget, "software": software_of(method), **step}
        return hash_json(content)

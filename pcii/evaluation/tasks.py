"""What an evaluation measures: every dataset at every light by every method, checked before any work."""

from collections.abc import Sequence
from dataclasses import dataclass

from pcii.base.errors import InputError
from pcii.depth.methods import check_range_mm
from pcii.evaluation.method_names import NamedMethod, estimator_of, methods_for
from pcii.evaluation.rows import Key, identity_of
from pcii.store.dataset import Dataset
from pcii.store.dataset_layout import TRUTH
from pcii.store.suggested_depths import depth_range_of, has_depths, planes_of
from pcii.types.photon_limit import FULL_LIGHT, Light


@dataclass(frozen=True)
class Task:
    """A dataset, light and method to score; `z_mm` are depths instead of those of the dataset, if any."""

    dataset: Dataset
    light: Light
    method: NamedMethod
    z_mm: tuple[float, ...] = ()

    @property
    def key(self) -> Key:
        """Key of its row."""
        return identity_of(self.dataset.manifest), self.light.stored, self.method.name, self.z_mm

    @property
    def data(self) -> Dataset:
        """The dataset in this light, read anew, so that tasks keep nothing in memory."""
        return self.dataset.at_light(self.light)


def tasks_of(
    datasets: Sequence[Dataset],
    methods: Sequence[NamedMethod],
    lights: Sequence[Light] = (),
    z_mm: Sequence[float] = (),
) -> list[Task]:
    """The tasks, dataset by dataset, each dataset once, at the depths `z_mm` or else those of its recipe.

    Without `methods` all that can take the data; without `lights` all that a dataset has. Raises `InputError`
    for a dataset without truth, two views, depths or a named light, and for a named method that can take none
    of its data.
    """
    tasks: dict[str, list[Task]] = {}
    for dataset in datasets:
        if not dataset.has(TRUTH):
            raise InputError(
                f"{dataset.path}: has no truth to score with: images of others, or left out by its recipe"
            )
        if dataset.grid.view_count < 2:
            raise InputError(f"{dataset.path}: one view has no depth; at least 2 cameras are needed")
        known = [dataset.at_light(light).light for light in lights] or dataset.lights
        if not known:
            raise InputError(f"{dataset.path}: has neither photon counts nor radiance to score methods on")
        own = [
            Task(dataset, light, method, tuple(map(float, z_mm)))
            for light in dict.fromkeys(known)
            for method in methods or _methods_for(dataset, light, z_mm)
            if method.takes(full_light=light == FULL_LIGHT)
        ]
        _check_methods(dataset, methods, own)
        _check_depths(dataset, own, z_mm)
        tasks.setdefault(identity_of(dataset.manifest), own)
    return [task for own in tasks.values() for task in own]


def _methods_for(dataset: Dataset, light: Light, z_mm: Sequence[float]) -> list[NamedMethod]:
    # Removal is of sections at depths that are named.
    has_planes = has_depths(dataset, z_mm)
    names = methods_for(full_light=light == FULL_LIGHT)
    return [NamedMethod(name) for name in names if has_planes or estimator_of(name)]


def _check_methods(dataset: Dataset, methods: Sequence[NamedMethod], tasks: Sequence[Task]) -> None:
    used = {task.method.name for task in tasks}
    for method in methods:
        if method.name not in used:
            kinds = ("photon counts", "radiance")
            needed, there = kinds if method.takes(full_light=False) else kinds[::-1]
            raise InputError(
                f"method: {method.name!r} needs {needed}, and of {dataset.path} {there} would be scored; use "
                f"{', '.join(methods_for(full_light=there == 'radiance'))}"
            )


def _check_depths(dataset: Dataset, tasks: Sequence[Task], z_mm: Sequence[float]) -> None:
    """Raise `InputError` for depths that methods need and nobody names, or cannot be searched."""
    of_depth = [estimator_of(task.method.name) is not None for task in tasks]
    if z_mm or not all(of_depth):
        planes_of(dataset, z_mm)
    if any(of_depth):
        try:
            check_range_mm(dataset.grid, depth_range_of(dataset, z_mm))
        except InputError as fault:
            raise InputError(f"{dataset.path}: {fault}") from None

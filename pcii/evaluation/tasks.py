"""What an evaluation measures: every dataset at every light by every method, checked before any work."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pcii.base.errors import InputError
from pcii.depth.depth_planes import check_range_mm
from pcii.evaluation.method_names import Function, estimator_of, full_name, methods_for
from pcii.evaluation.rows import Key, identity_of
from pcii.store.dataset import FULL_LIGHT, Budget, Dataset, budget_of
from pcii.store.dataset_layout import RADIANCE, TRUTH
from pcii.store.suggested_depths import depth_range_of, planes_of


@dataclass(frozen=True)
class Task:
    """A dataset, photon budget or full light, and method to score: full name, and function if it has one.

    `z_mm` are depths to look at instead of those that the dataset's recipe names, if any.
    """

    dataset: Dataset
    budget: Budget
    method: str
    function: Function | None
    z_mm: tuple[float, ...]

    @property
    def key(self) -> Key:
        """Key of its row."""
        return identity_of(self.dataset.manifest), self.budget, self.method, self.z_mm

    @property
    def data(self) -> Dataset:
        """The dataset with the photons of the budget, read anew, so that tasks keep nothing in memory."""
        return self.dataset.at_budget(self.budget)


def tasks_of(
    datasets: Sequence[Dataset],
    methods: Mapping[str, Function | None],
    budgets: Sequence[float | str],
    z_mm: Sequence[float] = (),
) -> list[Task]:
    """The tasks, dataset by dataset, each dataset once, at the depths `z_mm` or else those of its recipe.

    Without `methods` all that can take the data; without `budgets` all that a dataset has, and full light if
    it has radiance. Raises `InputError` for a dataset without truth, two views, depths or a named budget, and
    for a named method that can take none of its data.
    """
    tasks: dict[str, list[Task]] = {}
    for dataset in datasets:
        if not dataset.has(TRUTH):
            raise InputError(
                f"{dataset.path}: has no truth to score with: images of others, or left out by its recipe"
            )
        if dataset.grid.view_count < 2:
            raise InputError(f"{dataset.path}: one view has no depth; at least 2 cameras are needed")
        lights = _lights(dataset, budgets)
        by_light = {light: _names(dataset, methods, light, z_mm) for light in lights}
        if methods:
            _check_use(dataset, methods, lights)
        names = [name for each in by_light.values() for name in each]
        if z_mm or any(estimator_of(name) is None for name in names):
            planes_of(dataset, z_mm)
        if any(estimator_of(name) is not None for name in names):
            z_range_mm = depth_range_of(dataset, z_mm)
            try:
                check_range_mm(dataset.grid, z_range_mm)
            except InputError as fault:
                raise InputError(f"{dataset.path}: {fault}") from None
        each = [
            Task(dataset, light, name, methods.get(name), tuple(z_mm))
            for light in lights
            for name in by_light[light]
        ]
        tasks.setdefault(identity_of(dataset.manifest), each)
    return [task for each in tasks.values() for task in each]


def lights_of(dataset: Dataset) -> list[Budget]:
    """Photon budgets of a dataset, and full light if it has radiance."""
    found: list[Budget] = [*dataset.budgets]
    if dataset.has(RADIANCE):
        found.append(FULL_LIGHT)
    return found


def _lights(dataset: Dataset, budgets: Sequence[float | str]) -> list[Budget]:
    """The budgets to score at, with `FULL_LIGHT` for the radiance; `InputError` for one that is not there."""
    own = lights_of(dataset)
    if not own:
        raise InputError(f"{dataset.path}: has neither photon counts nor radiance to score methods on")
    chosen: list[Budget] = []
    for budget in budgets:
        named = budget_of(budget) if isinstance(budget, str) else budget
        dataset.at_budget(named)
        chosen.append(named)
    return list(dict.fromkeys(chosen or own))


def _names(
    dataset: Dataset, methods: Mapping[str, Function | None], light: Budget, z_mm: Sequence[float]
) -> list[str]:
    """Full names of the methods to apply at a light, each once."""
    full_light = light == FULL_LIGHT
    if methods:
        functions = [name for name, function in methods.items() if function is not None]
        found = (full_name(method, full_light=full_light, functions=functions) for method in methods)
        return list(dict.fromkeys(name for name in found if name is not None))
    # Removal is of sections at depths that are named.
    has_planes = bool(z_mm or dataset.analysis.get("z_mm"))
    return [name for name in methods_for(full_light=full_light) if has_planes or estimator_of(name)]


def _check_use(dataset: Dataset, methods: Mapping[str, Function | None], lights: Sequence[Budget]) -> None:
    """Raise `InputError` for a named method that takes neither kind of data that is scored."""
    kinds = {light == FULL_LIGHT for light in lights}
    for method in methods:
        if not any(_names(dataset, {method: methods[method]}, light, ()) for light in lights):
            (full_light,) = kinds
            lacking = "photon counts" if full_light else "radiance"
            taken = "radiance" if full_light else "photon counts"
            raise InputError(
                f"method: {method!r} needs {lacking}, and of {dataset.path} {taken} would be scored; use "
                f"{', '.join(methods_for(full_light=full_light))}"
            )

"""Methods pooled over scenes and ranked, on the datasets that all of them were scored on.

Each scene counts once, as the mean over its seeds: further seeds say more about the same scene, and only
other scenes say how far a result holds. Pairs are of the same scene and seed.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from pcii.evaluation.paired_tests import mean_interval, paired_difference
from pcii.evaluation.rows import Budget, Cells, Measure, by_light
from pcii.evaluation.tables import METHOD, P_VALUES, PHOTONS, Column, Table, tabulated, with_interval

FEWEST_SCENES = 2
"""One scene has no spread over scenes."""


def pooled(groups: Sequence[Cells], measure: Measure) -> list[dict[str, Any]]:
    """An entry for each budget at which methods were scored on the same datasets of two scenes or more.

    Its `methods` come in the order of their mean over scenes, the best first; methods that are equal share a
    `rank`. `difference` is a method's minus the best one's, scene by scene, with its interval and the `p` of
    a sign-flip test over scenes, of which `least_p` is the smallest that so many scenes can give.
    """
    entries: list[dict[str, Any]] = []
    budgets: set[Budget] = {budget for cells in groups for budget, _ in cells}
    for budget in sorted(budgets, key=by_light):
        methods = sorted({method for cells in groups for light, method in cells if light == budget})
        found = [_of_scene(cells, budget, methods, measure) for cells in groups]
        scenes = [scene for scene in found if scene]
        if len(methods) < 2 or len(scenes) < FEWEST_SCENES:
            continue
        values = {
            method: [sum(seeds) / len(seeds) for seeds in (scene[method] for scene in scenes)]
            for method in methods
        }
        means = {method: mean_interval(own, (0.0, 1.0)) for method, own in values.items()}
        order = sorted(methods, key=lambda method: -measure.sign * means[method].mean)
        datasets = sum(len(scene[methods[0]]) for scene in scenes)
        entry: dict[str, Any] = {"measure": measure.name, "budget": budget, "datasets": datasets}
        entry |= {"scenes": len(scenes), "methods": []}
        for method in order:
            better = sum(measure.sign * (each.mean - means[method].mean) > 0 for each in means.values())
            row = {"method": method, "rank": 1 + better, "mean": means[method].figures()}
            against = paired_difference(values[method], values[order[0]])
            compared = against.figures() if method != order[0] else dict.fromkeys(against.figures())
            entry["methods"].append(row | compared)
        entries.append(entry)
    return entries


def pooled_tables(evaluation: Mapping[str, Any]) -> list[Table]:
    """Methods ranked over all scenes, a table for each measure, without empty ones."""
    named = (("iou", "IoU", "IoU"), ("bad_1px", "Errors of depth above 1 px", "bad_1px"))
    tables = [
        _pooled(evaluation, measure, f"{title} over all scenes", name) for measure, title, name in named
    ]
    return [table for table in tables if table.rows]


def _pooled(evaluation: Mapping[str, Any], measure: str, title: str, name: str) -> Table:
    pools = [pool for pool in evaluation.get("pooled", ()) if pool["measure"] == measure]
    entries = [
        {name: pool[name] for name in ("budget", "scenes", "datasets")} | method
        for pool in pools
        for method in pool["methods"]
    ]
    last = [pool["methods"][-1]["rank"] for pool in pools for _ in pool["methods"]]
    first = {number for number, entry in enumerate(entries) if entry["rank"] == 1 < last[number]}

    def if_compared(column: Column) -> Column:
        return column[0], lambda entry: "–" if entry["difference"] is None else column[1](entry)

    mean = f"mean {name}"
    columns: list[Column] = [
        METHOD,
        PHOTONS,
        ("rank", lambda entry: str(entry["rank"])),
        (mean, lambda entry: with_interval(entry["mean"])),
        ("minus that of the best", lambda entry: with_interval(entry["difference"])),
        *map(if_compared, P_VALUES),
        ("scenes", lambda entry: str(entry["scenes"])),
        ("datasets", lambda entry: str(entry["datasets"])),
    ]
    return tabulated(title, columns, entries, best={"method": first, mean: first})


def _of_scene(
    cells: Cells, budget: Budget, methods: Sequence[str], measure: Measure
) -> dict[str, list[float]]:
    """Values of each method on the datasets of a scene that all have a value of; empty if there is none."""
    values = [
        {identity: measure.of(row) for identity, row in cells.get((budget, method), {}).items()}
        for method in methods
    ]
    common = [identity for identity in values[0] if all(each.get(identity) is not None for each in values)]
    if not common:
        return {}
    return {
        method: [value for identity in common if (value := each[identity]) is not None]
        for method, each in zip(methods, values, strict=True)
    }

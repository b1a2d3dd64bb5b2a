"""Findings on cost: bytes of each product, memory at the peak, which way the counts are made, time."""

import math

from simgen.counts import PHOTON_COST, SAMPLE_COST, SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST
from simgen.facts import Facts, Finding

BASE_BYTES = 4e8
"""What the renderer and its libraries take, whatever the recipe."""
VIEW_BYTES = 100.0
"""Of a pixel while its view is rendered: the film and what is added up from it."""
PHOTON_BYTES = 200.0
"""Of a photon while the counts are made."""
EVENT_BYTES = 16
"""Of a pixel that caught photons, on disk before compression: four indices and a count."""
MOST_MEMORY = 0.8
TRUTH_BYTES = 6
"""Depth (float32) and object (int16) of a pixel."""


def cost_findings(facts: Facts) -> list[Finding]:
    """What will be written and what it takes, before compression and to an order of magnitude."""
    sizes = product_bytes(facts)
    text = ", ".join(f"{name} {in_bytes(size)}" for name, size in sizes.items()) or "nothing but a manifest"
    found = [Finding("ok", "size", f"{text}, before compression")]
    peak = peak_bytes(facts)
    text = f"some {in_bytes(peak)} of memory at the peak"
    room = facts.memory_bytes
    if room is not None and peak > MOST_MEMORY * room:
        remedy = "make fewer photons or leave out products.view_truth"
        found.append(Finding("warn", "memory", f"{text}, and this machine has {in_bytes(room)}", remedy))
    else:
        found.append(Finding("ok", "memory", text))
    way = ""
    if facts.plan is not None:
        way = "photons one by one (thinning)"
        if not facts.plan.thins:
            way = f"counts drawn from views of {facts.plan.samples} samples per pixel"
    if facts.recipe.products.radiance != "none":
        way += f"{', ' if way else ''}full-light images"
    way = f"{way}; " if way else ""
    found.append(Finding("ok", "time", f"{way}in the order of {in_time(seconds(facts))} on this machine"))
    return found


def product_bytes(facts: Facts) -> dict[str, float]:
    """Bytes of each product that the recipe asks for, before compression."""
    grid, products = facts.grid, facts.recipe.products
    pixels = grid.height * grid.width
    everywhere = pixels * grid.view_count
    sizes: dict[str, float] = {}
    if facts.plan is not None:
        sizes["counts"] = EVENT_BYTES * min(_photons(facts), everywhere)
    if products.radiance != "none":
        sizes["radiance"] = 4.0 * everywhere * (3 if products.radiance == "rgb" else 1)
    truth = pixels * products.truth + everywhere * bool(products.view_truth)
    if truth:
        sizes["truth"] = TRUTH_BYTES * truth
    return sizes


def peak_bytes(facts: Facts) -> float:
    """Memory that the largest step takes: a view, the photons, or the truth of all views at once."""
    grid, pixels = facts.grid, facts.grid.height * facts.grid.width
    steps = [VIEW_BYTES * pixels]
    if facts.plan is not None:
        events = _photons(facts) if facts.plan.thins else min(_photons(facts), pixels * grid.view_count)
        steps.append(PHOTON_BYTES * events)
    if facts.recipe.products.view_truth:
        steps.append(TRUTH_BYTES * pixels * grid.view_count)
    return BASE_BYTES + max(steps)


def seconds(facts: Facts) -> float:
    """Time of rendering and of photons, from the probe's speed; nothing else is counted."""
    grid, recipe, plan = facts.grid, facts.recipe, facts.plan
    everywhere = grid.height * grid.width * grid.view_count
    spent = 0.0
    if recipe.products.truth:
        spent += facts.hit_s * grid.height * grid.width
    if recipe.products.view_truth:
        spent += facts.hit_s * everywhere
    dense = plan is not None and not plan.thins
    if recipe.products.radiance != "none" or dense:
        samples = plan.samples if plan is not None and dense else recipe.render.samples_per_pixel
        spent += facts.path_s * samples * everywhere
    if plan is not None and plan.thins:
        costs = (PHOTON_COST, SAMPLE_COST) if facts.compiled else (SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST)
        spent += facts.path_s * costs[0] / costs[1] * _photons(facts)
    return spent


def _photons(facts: Facts) -> float:
    assert facts.plan is not None
    return facts.plan.photons_per_view * facts.grid.view_count


def in_bytes(size: float) -> str:
    """A size in the unit that suits it, with two digits."""
    unit = min(max(0, math.floor(math.log10(max(size, 1)) / 3)), 4)
    return f"{_rounded(size / 1000**unit, 2)} {('B', 'kB', 'MB', 'GB', 'TB')[unit]}"


def in_time(spent_s: float) -> str:
    """A time in the unit that suits it, with one digit; no less than a second."""
    for size, unit in ((86400, "days"), (3600, "hours"), (60, "minutes")):
        if spent_s >= 2 * size:
            return f"{_rounded(spent_s / size, 1)} {unit}"
    return f"{_rounded(max(spent_s, 1), 1)} s"


def _rounded(value: float, digits: int) -> str:
    places = digits - 1 - math.floor(math.log10(value)) if value > 0 else 0
    return f"{round(value, places):.{max(places, 0)}f}".removesuffix(".0")

"""Findings on cost: bytes of each product, memory at the peak, which way the counts are made, time."""

from simgen.check.scene_facts import Facts, Finding
from simgen.dataset.resources import (
    Needs,
    available_bytes,
    in_bytes,
    least_rendered_bytes,
    peak_bytes,
    product_bytes,
    shortage,
)
from simgen.photons.counting_plan import PHOTON_COST, SAMPLE_COST, SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST

MOST_MEMORY = 0.8
USUAL_SHARE = 0.25
"""Share of the candidates that is kept where a photon costs `PHOTON_COST`; where fewer are, it costs more."""


def hopeless(needs: Needs) -> list[Finding]:
    """What cannot even be looked at, since memory cannot hold it whatever the scene; empty if it can be."""
    room = available_bytes()
    lacking = shortage(needs, None, room)
    return [] if lacking is None else [Finding("bad", "memory", lacking)]


def cost_findings(facts: Facts) -> list[Finding]:
    """What will be written and what it takes, before compression and to an order of magnitude."""
    needs, plan, room = facts.needs, facts.plan, facts.memory_bytes
    sizes = product_bytes(needs, plan)
    text = ", ".join(f"{name} {in_bytes(size)}" for name, size in sizes.items()) or "nothing but a manifest"
    found = [Finding("ok", "size", f"{text}, before compression")]
    files = least_rendered_bytes(needs, plan)
    if files > facts.disk_bytes:
        left = in_bytes(facts.disk_bytes)
        text = f"rendered views take {in_bytes(files)} or more, and this folder's disk has {left} left"
        found = [Finding("warn", "size", text, "take fewer or smaller views, or another disk")]
    peak = peak_bytes(needs, plan)
    text = f"some {in_bytes(peak)} of memory at the peak"
    lacking = shortage(needs, plan, room)
    if lacking is not None:
        found.append(Finding("bad", "memory", lacking))
    elif peak > MOST_MEMORY * room:
        text = f"{text}, and this machine has {in_bytes(room)} available"
        found.append(Finding("warn", "memory", text, "make fewer photons or smaller views"))
    else:
        found.append(Finding("ok", "memory", text))
    way = ""
    if facts.plan is not None:
        kept = "" if facts.plan.keeps_origins else ", whose origins are too many to be kept"
        way = f"photons one by one (thinning){kept}"
        if not facts.plan.thins:
            way = f"counts drawn from views of {facts.plan.samples} samples per pixel"
            if facts.plan.why_rendered:
                way += f", since {facts.plan.why_rendered}"
    if facts.needs.products.radiance != "none":
        way += f"{', ' if way else ''}full-light images"
    way = f"{way}; " if way else ""
    found.append(Finding("ok", "time", f"{way}in the order of {in_time(seconds(facts))} on this machine"))
    return found


def seconds(facts: Facts) -> float:
    """Time of rendering and of photons, from the probe's speed; nothing else is counted."""
    grid, products, plan = facts.grid, facts.needs.products, facts.plan
    everywhere = grid.height * grid.width * grid.view_count
    spent = 0.0
    if products.truth:
        spent += facts.hit_s * grid.height * grid.width
    if products.view_truth:
        spent += facts.hit_s * everywhere
    dense = plan is not None and not plan.thins
    if products.radiance != "none" or dense:
        samples = plan.samples if plan is not None and dense else facts.render.samples_per_pixel
        spent += facts.path_s * samples * everywhere
    if plan is not None and plan.thins:
        costs = (PHOTON_COST, SAMPLE_COST) if facts.compiled else (SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST)
        share = USUAL_SHARE if plan.explored is None else plan.explored.share
        dearer = max(USUAL_SHARE / share, 1.0)
        spent += facts.path_s * costs[0] / costs[1] * _photons(facts) * dearer
    return spent


def _photons(facts: Facts) -> float:
    assert facts.plan is not None
    return facts.plan.photons_per_view * facts.grid.view_count


def in_time(spent_s: float) -> str:
    """A time in the unit that suits it, with one digit; no less than a second."""
    for size, unit in ((86400, "days"), (3600, "hours"), (60, "minutes")):
        if spent_s >= 2 * size:
            return f"{_one_digit(spent_s / size)} {unit}"
    return f"{_one_digit(max(spent_s, 1))} s"


def _one_digit(value: float) -> str:
    return f"{float(f'{value:.1g}'):g}"

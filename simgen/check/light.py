"""Findings on photons of each object and voxel, and on size, memory and time."""

import math

import numpy as np

from pcii.types import NEGLIGIBLE_LOSS, channel_count, clipped_mean
from simgen.check.facts import Facts, Finding, ObjectFacts
from simgen.dataset import in_bytes, peak_bytes, product_bytes, shortage
from simgen.photons import PHOTON_COST, SAMPLE_COST, SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST

MIN_PHOTONS = 100
"""Fewest photons, over all views, that show an object."""
MIN_VOXEL_COUNTS = 0.1
MAX_OTHER_SHARE = 0.5
"""Share of the photons that may come from no object, and of the counts that no photon made."""
LEAST_NAMED_SHARE = 0.0005
"""Smaller shares are not named: they would be printed as 0.0 %."""
USUAL_SHARE = 0.25
"""Share of the candidates that is kept where a photon costs `PHOTON_COST`; where fewer are, it costs more."""


def photon_findings(facts: Facts) -> list[Finding]:
    """Photons of each object, of what is none, saturation, dark counts; none without counts or light."""
    if facts.plan is None or facts.luminance <= 0 or not facts.plan.photons_per_view > 0:
        return []
    total = photons_per_view(facts, np.ones(facts.colour_share.size))
    findings = [_object_finding(facts, thing, total) for thing in facts.visible_objects]
    if facts.visible_objects:
        findings += _other_findings(facts, total)
    findings += _saturation_findings(facts)
    sensor, grid = facts.target.recipe.sensor, facts.grid
    dark = (sensor.dark_counts + sensor.hot_pixel_share * sensor.hot_pixel_counts) * grid.height * grid.width
    dark += facts.target.map_counts / grid.view_count
    if dark > MAX_OTHER_SHARE * (dark + total):
        text = f"{_number(dark)} dark counts per view, {dark / (dark + total):.0%} of all counts"
        findings.append(Finding("warn", "photons", text, "take more light, or a sensor with fewer"))
    return findings


def _other_findings(facts: Facts, total: float) -> list[Finding]:
    """Which share of the photons comes from no object, and which from objects that count in no score."""
    shares = {name: photons_per_view(facts, share) / total for name, share in facts.other_shares.items()}
    findings, whole = [], sum(shares.values())
    if whole >= LEAST_NAMED_SHARE:
        parts = (f"{name} {part:.1%}" for name, part in shares.items() if part >= LEAST_NAMED_SHARE)
        text = f"{whole:.1%} of the photons come from no object: {', '.join(parts)}"
        if whole > MAX_OTHER_SHARE:
            remedy = "set visible = false of the light from all around, darken the others, or take more light"
            findings.append(Finding("warn", "photons", text, remedy))
        else:
            findings.append(Finding("ok", "photons", text))
    unscored = [thing for thing in facts.visible_objects if not thing.is_scored]
    if unscored:
        part = sum(photons_per_view(facts, thing.light_share) for thing in unscored) / total
        text = f"{part:.1%} of the photons come from objects that count in no score"
        findings.append(Finding("ok", "photons", text))
    return findings


def photons_per_view(facts: Facts, light_share: np.ndarray) -> float:
    """Counts that a view is expected to have of what sends these shares (C,) of the light in each colour.

    A budget per view is shared by all colours in proportion to their light, one per channel is each
    colour's own. What the sensor does not detect is left out.
    """
    assert facts.plan is not None
    sensor, photons = facts.target.recipe.sensor, facts.target.recipe.photons
    channels = channel_count(sensor.bayer)
    weights = np.full(channels, 1 / channels) if photons.scope == "channel" else facts.colour_share
    efficiency = np.array(sensor.quantum_efficiency)
    if sensor.bayer is None:
        efficiency = efficiency[1:2]
    return float(facts.plan.photons_per_view * (weights * efficiency * light_share).sum())


def _object_finding(facts: Facts, thing: ObjectFacts, total: float) -> Finding:
    views = facts.grid.view_count
    per_view = photons_per_view(facts, thing.light_share)
    per_voxel = _per_pixel(facts, thing) * views
    text = (
        f"{thing.name}: {_number(per_view)} per view ({per_view / total:.1%}), {_number(per_view * views)} "
        f"in all, {per_voxel:.2g} per voxel"
    )
    factor = max(MIN_PHOTONS / max(per_view * views, 1e-9), MIN_VOXEL_COUNTS / max(per_voxel, 1e-9))
    if factor <= 1:
        return Finding("ok", "photons", text)
    remedy = f"expose {factor:.2g} times as long"
    if facts.target.recipe.photons.scope != "exposure":
        budget = facts.target.recipe.photons.budget * factor
        step = 10 ** max(0, math.floor(math.log10(budget)) - 1)
        remedy = f"photons.budget = {math.ceil(budget / step) * step}"
    return Finding("warn", "photons", text, f"{remedy}, or larger pixels")


def _per_pixel(facts: Facts, thing: ObjectFacts) -> float:
    """Counts of one view's pixel, over the whole exposure, where it sees the object."""
    pixels = facts.grid.height * facts.grid.width
    return photons_per_view(facts, thing.light_share) / max(thing.film_share * pixels, 1e-9)


def _saturation_findings(facts: Facts) -> list[Finding]:
    """What frames of few bits lose of the object that is brightest on the film."""
    sensor = facts.target.recipe.sensor
    limit = sensor.readout.most_per_frame
    if limit is None or not facts.visible_objects:
        return []
    brightest = max(facts.visible_objects, key=lambda thing: _per_pixel(facts, thing))
    per_frame = _per_pixel(facts, brightest) / sensor.frames
    lost = 1 - float(clipped_mean(np.array(per_frame), limit)) / per_frame if per_frame > 0 else 0.0
    text = f"{brightest.name}: {per_frame:.2g} photons per pixel and frame, of which {lost:.1%} saturate"
    if lost <= NEGLIGIBLE_LOSS:
        return [Finding("ok", "photons", text)]
    return [Finding("warn", "photons", text, "raise sensor.frames, or take less light")]


def _number(value: float) -> str:
    """A whole number where it is large, three digits where it is small."""
    return f"{value:,.0f}" if 10 <= value < 1e7 else f"{value:.3g}"


def cost_findings(facts: Facts) -> list[Finding]:
    """What will be written and what it takes, before compression and to an order of magnitude."""
    recipe, plan, dark = facts.target.recipe, facts.plan, facts.target.map_counts
    sizes = product_bytes(recipe, plan)
    size = ", ".join(f"{name} {in_bytes(of_name)}" for name, of_name in sizes.items()) or "only a manifest"
    lack = shortage(recipe, plan, facts.memory_bytes, dark)
    peak, room = in_bytes(peak_bytes(recipe, plan, dark)), in_bytes(facts.memory_bytes)
    memory = f"{peak} at the peak, of {room} available"
    return [
        Finding("ok", "size", f"{size}, before compression"),
        Finding("ok", "memory", memory) if lack is None else Finding("bad", "memory", lack),
        Finding("ok", "time", f"{_way(facts)}in the order of {in_time(seconds(facts))} on this machine"),
    ]


def _way(facts: Facts) -> str:
    """How photons and images are made, as the beginning of a sentence."""
    plan, ways = facts.plan, []
    if plan is not None and plan.thins:
        ways.append("photons one by one (thinning)")
        if not plan.keeps_origins:
            ways.append("too many to keep their origins")
    elif plan is not None:
        ways.append(f"counts drawn from views of {plan.samples} samples per pixel")
        if plan.why_rendered:
            ways.append(f"since {plan.why_rendered}")
    if facts.target.recipe.products.radiance != "none":
        ways.append("full-light images")
    return f"{', '.join(ways)}; " if ways else ""


def seconds(facts: Facts) -> float:
    """Time of rendering and of photons, from the probe's speed; nothing else is counted."""
    grid, products, plan = facts.grid, facts.target.recipe.products, facts.plan
    pixels = grid.height * grid.width
    spent_s = facts.hit_s * pixels * (products.truth + grid.view_count * bool(products.view_truth))
    samples = facts.target.recipe.render.samples_per_pixel if products.radiance != "none" else 0
    if plan is not None and not plan.thins:
        samples = plan.samples
    spent_s += facts.path_s * samples * pixels * grid.view_count
    if plan is not None and plan.thins:
        cost = PHOTON_COST / SAMPLE_COST if facts.is_compiled else SCALAR_PHOTON_COST / SCALAR_SAMPLE_COST
        share = USUAL_SHARE if plan.known_places is None else plan.kept_share
        paths_per_photon = cost * max(USUAL_SHARE / share, 1.0)
        spent_s += facts.path_s * paths_per_photon * plan.photons_per_view * grid.view_count
    return spent_s


def in_time(spent_s: float) -> str:
    """A time in the unit that suits it, with one digit; no less than a second."""
    units = ((86400, "days"), (3600, "hours"), (60, "minutes"))
    size_s, unit = next(((size_s, unit) for size_s, unit in units if spent_s >= 2 * size_s), (1, "s"))
    return f"{float(f'{max(spent_s, 1) / size_s:.1g}'):g} {unit}"

"""Findings on photons: who sends them, how many an object and a voxel get, and how many come by mistake."""

import math

import numpy as np

from pcii.core.bayer import channel_count
from pcii.core.photon_events import NEGLIGIBLE_LOSS, clipped_mean
from simgen.check.scene_facts import Facts, Finding, ObjectFacts

LEAST_PHOTONS = 100
"""Below so many, over all views, there is hardly an object to be seen."""
LEAST_VOXEL_COUNTS = 0.1
MOST_LOST_SHARE = 0.5
MOST_FALSE_SHARE = 0.5


def photon_findings(facts: Facts) -> list[Finding]:
    """All findings of this file; none without counts or without light."""
    if facts.plan is None or facts.luminance <= 0 or not facts.plan.photons_per_view > 0:
        return []
    found = [_object_finding(facts, thing) for thing in facts.seen]
    total = photons_per_view(facts, np.ones(channel_count(facts.sensor.bayer)))
    for place, share in facts.elsewhere.items():
        lost = photons_per_view(facts, share) / total
        if lost > 0.0005:
            much = lost > MOST_LOST_SHARE and bool(facts.seen)
            more = "expose longer" if facts.photons.scope == "exposure" else "raise photons.budget"
            remedy = f"darken it, or {more} for the objects" if much else ""
            text = f"{place}: {lost:.1%} of the photons"
            found.append(Finding("warn" if remedy else "ok", "photons", text, remedy))
    return found + _saturation_findings(facts) + _false_findings(facts, total)


def photons_per_view(facts: Facts, light_share: np.ndarray) -> float:
    """Counts that a view is expected to have of what sends these shares (C,) of the light in each colour.

    A budget per view is shared by all colours in proportion to their light, one per channel is each
    colour's own. What the sensor does not detect is left out.
    """
    assert facts.plan is not None
    weights = channel_weights(facts)
    sensor = facts.sensor
    kept = np.array(sensor.quantum_efficiency)
    if facts.sensor.bayer is None:
        kept = kept[1:2]
    return float(facts.plan.photons_per_view * (weights * kept * light_share).sum())


def channel_weights(facts: Facts) -> np.ndarray:
    """Share (C,) of a view's photons that each colour gets."""
    channels = channel_count(facts.sensor.bayer)
    if facts.photons.scope == "channel":
        return np.full(channels, 1 / channels)
    return facts.colour_share


def _object_finding(facts: Facts, thing: ObjectFacts) -> Finding:
    grid = facts.grid
    total = photons_per_view(facts, np.ones(channel_count(facts.sensor.bayer)))
    expected = photons_per_view(facts, thing.light_share)
    everywhere = expected * grid.view_count
    voxel = _per_pixel(facts, thing, grid.height * grid.width) * grid.view_count
    error = f", a relative error of {1 / math.sqrt(voxel):.0%}" if voxel > 0 else ""
    text = (
        f"{thing.name}: {expected / total:.1%}, {_number(expected)} per view, {_number(everywhere)} in all; "
        f"{voxel:.2g} per voxel{error}"
    )
    if everywhere < LEAST_PHOTONS:
        remedy = _more(facts, LEAST_PHOTONS / max(everywhere, 1e-9), f"for {LEAST_PHOTONS} of them")
        return Finding("warn", "photons", text, remedy)
    if voxel < LEAST_VOXEL_COUNTS:
        return Finding("warn", "photons", text, _more(facts, 1 / voxel, "for 1 per voxel, or larger pixels"))
    if voxel < 1:
        return Finding("note", "photons", text, f"{math.ceil(1 / voxel)} voxels share a photon: pool them")
    return Finding("ok", "photons", text)


def _saturation_findings(facts: Facts) -> list[Finding]:
    """What frames of few bits lose of the object that is brightest on the film."""
    sensor, grid = facts.sensor, facts.grid
    most = sensor.readout.most_per_frame
    if most is None or not facts.seen:
        return []
    pixels = grid.height * grid.width
    brightest, thing = max(
        ((_per_pixel(facts, thing, pixels), thing) for thing in facts.seen), key=lambda pair: pair[0]
    )
    per_frame = brightest / sensor.frames
    lost = 1 - float(clipped_mean(np.array(per_frame), most)) / per_frame if per_frame > 0 else 0.0
    text = f"{thing.name}: {per_frame:.2g} photons per pixel and frame, of which {lost:.1%} saturate"
    if lost <= NEGLIGIBLE_LOSS:
        return [Finding("ok", "photons", text)]
    return [Finding("warn", "photons", text, "raise sensor.frames, or take less light")]


def _per_pixel(facts: Facts, thing: ObjectFacts, pixels: int) -> float:
    """Counts of one view's pixel, over the whole exposure, where it sees the object."""
    return photons_per_view(facts, thing.light_share) / max(thing.film_share * pixels, 1e-9)


def _more(facts: Facts, factor: float, purpose: str) -> str:
    if facts.photons.scope == "exposure":
        return f"expose {factor:.2g} times as long {purpose}"
    budget = facts.photons.budget * factor
    step = 10 ** max(0, math.floor(math.log10(budget)) - 1)
    return f"photons.budget = {math.ceil(budget / step) * step} {purpose}"


def _false_findings(facts: Facts, counted: float) -> list[Finding]:
    sensor, grid = facts.sensor, facts.grid
    per_pixel = sensor.dark_counts + sensor.hot_pixel_share * sensor.hot_pixel_counts
    if not per_pixel:
        return []
    dark = per_pixel * grid.height * grid.width
    share = dark / (dark + counted)
    text = f"{_number(dark)} dark counts per view, {share:.0%} of all counts"
    much = share > MOST_FALSE_SHARE
    return [Finding("warn" if much else "ok", "photons", text, "lower sensor.dark_counts" if much else "")]


def _number(value: float) -> str:
    """A whole number where it is large, three digits where it is small."""
    return f"{value:,.0f}" if 10 <= value < 1e7 else f"{value:.3g}"

"""Findings on depth: disparities, how far objects stand apart in px of blur, planes, colours that alias."""

import math
from itertools import pairwise

import numpy as np

from pcii.core.bayer import COLOURS
from simgen.cameras.disparities import (
    apart_px,
    disparities_px,
    mending_depth_mm,
    mending_pitch_mm,
    share_seen_by_all,
    shares_without,
    spread_px_mm,
)
from simgen.check.scene_facts import Facts, Finding, ObjectFacts, listed

LEAST_SPREAD_PX = 2.0
"""Below this blur between nearest and farthest all of a scene is in focus at once."""
LEAST_APART_PX = 3.0
"""Below this blur two objects are hard to tell apart by focus."""
ONE_PLANE_PX = 0.5
"""Within this blur two objects stand in one plane."""
FOCUS_PX = 1.0
"""A point is in focus where its blur reaches so many px to either side."""
LEAST_FOCUS_SHARE = 0.05
LEAST_SEEN_BY_ALL = 0.5
MOST_PITCH_FACTOR = 3.0
"""Cameras are not to be moved further apart than this only to tell two objects apart."""
MOST_LINES = 8
"""So many pairs of objects are listed one by one."""


def depth_findings(facts: Facts) -> list[Finding]:
    """All findings of this file; a single camera has no disparity and gets one line."""
    grid = facts.grid
    if grid.view_count == 1:
        return [Finding("note", "disparity", "one camera has none: depths cannot be told apart")]
    return [
        *disparity_findings(facts),
        *separation_findings(facts),
        *no_planes_findings(facts),
        *focus_findings(facts),
        *overlap_findings(facts),
        *alias_findings(facts),
    ]


def disparity_findings(facts: Facts) -> list[Finding]:
    """Disparity of the nearest and farthest point of any object, and the blur between the two."""
    grid, found = facts.grid, []
    if facts.backdrop_mm is not None:
        away = f"{_disparity(facts, facts.backdrop_mm)} at the backdrop, {facts.backdrop_mm:g} mm"
        found.append(Finding("ok", "disparity", away))
    if not facts.seen:
        return found
    near, far = _depths_seen(facts)
    spread = float(apart_px(grid, near, far))
    text = (
        f"{_disparity(facts, near)} at the nearest point, {near:.0f} mm; {_disparity(facts, far)} at the "
        f"farthest, {far:.0f} mm; {spread:.1f} px of blur between them"
    )
    pitch = " x ".join(f"{p * LEAST_APART_PX / max(spread, 1e-9):.3g}" for p in grid.pitch_mm)
    flat = spread < ONE_PLANE_PX
    remedy = "all is at one depth" if flat else f"a pitch of {pitch} mm makes it {LEAST_APART_PX:g} px"
    few = spread < LEAST_SPREAD_PX
    found.insert(0, Finding("warn" if few else "ok", "disparity", text, remedy if few else ""))
    across, down = disparities_px(grid, near)
    if (grid.cols > 1 and abs(across) >= grid.width) or (grid.rows > 1 and abs(down) >= grid.height):
        text = f"neighbouring views no longer overlap at {near:.0f} mm"
        found.append(Finding("bad", "disparity", text, "take a smaller pitch or move the scene away"))
    return found


def separation_findings(facts: Facts) -> list[Finding]:
    """Blur between objects that are neighbours in depth, by the medians of what is seen of them."""
    ordered = sorted(facts.seen, key=lambda thing: thing.middle_mm)
    found = [_separation(facts, near, far) for near, far in pairwise(ordered)]
    if len(found) <= MOST_LINES:
        return found
    quiet = [finding for finding in found if finding.verdict != "warn"]
    listed_first = [finding for finding in found if finding.verdict == "warn"][:MOST_LINES]
    rest = len(found) - len(listed_first) - len(quiet)
    if quiet:
        text = f"{len(quiet)} more pairs of neighbours in depth are further apart or in one plane"
        listed_first.append(Finding("ok", "separation", text))
    if rest:
        listed_first.append(Finding("warn", "separation", f"{rest} more pairs are as close"))
    return listed_first


def _separation(facts: Facts, near: ObjectFacts, far: ObjectFacts) -> Finding:
    apart = float(apart_px(facts.grid, near.middle_mm, far.middle_mm))
    text = f"{near.name} ({near.middle_mm:.0f} mm) and {far.name} ({far.middle_mm:.0f} mm): {apart:.2f} px"
    if apart < ONE_PLANE_PX:
        return Finding("note", "separation", f"{text} of blur, in one plane for these cameras")
    if apart >= LEAST_APART_PX:
        return Finding("ok", "separation", f"{text} of blur apart")
    ways, factor = [], LEAST_APART_PX / apart
    inverse = 1 / near.middle_mm - LEAST_APART_PX / spread_px_mm(facts.grid)
    if inverse > 0:
        ways.append(f"move {far.name} {math.ceil(1 / inverse - far.middle_mm)} mm further away")
    if factor <= MOST_PITCH_FACTOR or not ways:
        ways.append(f"take a pitch of {' x '.join(f'{p * factor:.3g}' for p in facts.grid.pitch_mm)} mm")
    return Finding("warn", "separation", f"{text} of blur apart", " or ".join(ways))


def no_planes_findings(facts: Facts) -> list[Finding]:
    """Whether neither scene nor recipe names depths, so that `pcii` needs `--z-mm` each time."""
    if facts.analysis.z_mm:
        return []
    listed_mm = ", ".join(f"{z:g}" for z in facts.planes_mm) or "..."
    text = "neither the scene nor the recipe names depths to look at, and pcii asks for --z-mm"
    return [Finding("warn", "focus", text, f"add planes_mm = [{listed_mm}] to the scene")]


def focus_findings(facts: Facts) -> list[Finding]:
    """How deep each object is in px of blur, its share in focus at its nearest plane, planes without any."""
    found, used, planes = [], set[float](), facts.planes_mm
    for thing in facts.seen:
        near, far = float(thing.z_mm.min()), float(thing.z_mm.max())
        share, plane = max((focus_share(facts, thing, z), z) for z in planes)
        used |= {z for z in planes if focus_share(facts, thing, z) > 0}
        text = (
            f"{thing.name}: {near:.0f} to {far:.0f} mm, {float(apart_px(facts.grid, near, far)):.1f} px "
            f"deep; {share:.0%} of it in focus at {plane:g} mm"
        )
        remedy = f"add {round(thing.middle_mm)} to analysis.z_mm"
        poor = share < LEAST_FOCUS_SHARE
        found.append(Finding("warn" if poor else "ok", "focus", text, remedy if poor else ""))
    for z in facts.analysis.z_mm:
        if z not in used:
            text = f"no object is in focus at the plane {z:g} mm"
            found.append(Finding("warn", "focus", text, "take it from analysis.z_mm or move an object there"))
    return found + _range_findings(facts)


def focus_share(facts: Facts, thing: ObjectFacts, z_mm: float) -> float:
    """Share of what is seen of an object whose blur at the plane reaches at most `FOCUS_PX` to each side."""
    return float((apart_px(facts.grid, thing.z_mm, z_mm) / 2 <= FOCUS_PX).mean())


def _range_findings(facts: Facts) -> list[Finding]:
    limits = facts.analysis.z_range_mm
    if limits is None or not facts.seen:
        return []
    outside = [t.name for t in facts.seen if t.z_mm.min() < limits[0] or t.z_mm.max() > limits[1]]
    text = f"depth maps look from {limits[0]:g} to {limits[1]:g} mm"
    if not outside:
        return [Finding("ok", "focus", f"{text}, where all objects are")]
    near, far = _depths_seen(facts)
    if not any(((t.z_mm >= limits[0]) & (t.z_mm <= limits[1])).any() for t in facts.seen):
        return [Finding("bad", "focus", f"{text}, where no object is", _range_mm(near, far))]
    remedy = _range_mm(min(limits[0], near), max(limits[1], far))
    return [Finding("warn", "focus", f"{text}, and part of {listed(outside)} is outside", remedy)]


def _depths_seen(facts: Facts) -> tuple[float, float]:
    """The nearest and the farthest depth of any object that is seen."""
    return float(min(t.z_mm.min() for t in facts.seen)), float(max(t.z_mm.max() for t in facts.seen))


def _range_mm(near: float, far: float) -> str:
    return f"analysis.z_range_mm = [{np.floor(near):.0f}, {np.ceil(far):.0f}]"


def overlap_findings(facts: Facts) -> list[Finding]:
    """Share of the sections that every camera sees, where it is least and where it is largest."""
    if not facts.planes_mm:
        return []
    views = facts.grid.view_count
    shares = {z: share_seen_by_all(facts.grid, z) for z in (min(facts.planes_mm), max(facts.planes_mm))}
    seen_shares = " and ".join(f"{share:.0%} of the section at {z:g} mm" for z, share in shares.items())
    text = f"all {views} views see {seen_shares}"
    if min(shares.values()) >= LEAST_SEEN_BY_ALL:
        return [Finding("ok", "overlap", text)]
    return [Finding("warn", "overlap", text, "take a smaller pitch, fewer cameras or a wider film")]


def alias_findings(facts: Facts) -> list[Finding]:
    """Planes at which the cameras' shifts leave voxels without one of the colours of the Bayer pattern."""
    grid, cfa = facts.grid, facts.sensor.bayer
    if cfa is None or not facts.planes_mm:
        return []
    found = []
    for z in facts.planes_mm:
        without = shares_without(grid, cfa, z)
        if not without.any():
            continue
        across, down = disparities_px(grid, z)
        lacking = ", ".join(f"{s:.0%} have no {c}" for c, s in zip(COLOURS, without, strict=True) if s)
        text = (
            f"shifts at {z:g} mm ({across:.2f} x {down:.2f} px) keep the Bayer phase: of its voxels {lacking}"
        )
        found.append(Finding("warn", "colours", text, _mended(facts, z)))
    if not found:
        planes = listed([f"{z:g}" for z in facts.planes_mm])
        found.append(Finding("ok", "colours", f"every voxel has all three at {planes} mm"))
    return found


def _mended(facts: Facts, z_mm: float) -> str:
    pitch, depth = mending_pitch_mm(facts.grid, facts.planes_mm), mending_depth_mm(facts.grid, z_mm)
    ways = [] if pitch is None else [f"take a pitch of {pitch[0]:g} x {pitch[1]:g} mm"]
    ways += [] if depth is None else [f"look at {depth:g} mm"]
    return " or ".join(ways) or "add camera rows and columns, or set sensor.cfa = 'none'"


def _disparity(facts: Facts, z_mm: float) -> str:
    across, down = disparities_px(facts.grid, z_mm)
    return f"{across:.2f} px" if np.isclose(across, down) else f"{across:.2f} x {down:.2f} px"

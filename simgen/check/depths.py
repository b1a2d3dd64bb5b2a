"""Findings on depth: disparities, blur between objects, planes, overlap, colours that are missing."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from pcii.types import COLOURS
from simgen.cameras import (
    apart_px,
    disparities_px,
    mending_pitch_mm,
    share_seen_by_all,
    shares_without,
    spread_px_mm,
)
from simgen.check.facts import Facts, Finding, ObjectFacts, listed

MIN_SPREAD_PX = 2.0
"""Below this blur between nearest and farthest all of a scene is in focus at once."""
MIN_APART_PX = 3.0
"""Below this blur two objects are hard to tell apart by focus."""
ONE_PLANE_PX = 0.5
"""Within this blur two objects stand in one plane, which is taken to be on purpose."""
FOCUS_PX = 1.0
"""Largest reach of the blur, in px to either side, of a point that is in focus."""
MIN_FOCUS_SHARE = 0.05
MIN_OVERLAP = 0.5


def depth_findings(facts: Facts) -> list[Finding]:
    """All findings of this file; of a single camera, which has no disparity, one."""
    if facts.grid.view_count == 1:
        return [Finding("ok", "disparity", "one camera has none: depths cannot be told apart")]
    if not facts.planes_mm:
        return []
    findings: list[Finding] = []
    if facts.visible_objects:
        findings = [_disparity_finding(facts), *_separation_findings(facts)]
    if facts.scored:
        findings += _focus_findings(facts)
    return [*findings, _overlap_finding(facts), *_colour_findings(facts)]


def _disparity_finding(facts: Facts) -> Finding:
    """Disparity of the nearest and farthest point of any object, and the blur between the two."""
    grid, (near_mm, far_mm) = facts.grid, _depths_of(facts.visible_objects)
    spread_px = float(apart_px(grid, near_mm, far_mm))
    text = (
        f"{_disparity(facts, near_mm)} at the nearest point, {near_mm:.0f} mm, and "
        f"{_disparity(facts, far_mm)} at the farthest, {far_mm:.0f} mm: {spread_px:.1f} px of blur in between"
    )
    across_px, down_px = disparities_px(grid, near_mm)
    if (grid.cols > 1 and abs(across_px) >= grid.width) or (grid.rows > 1 and abs(down_px) >= grid.height):
        remedy = "neighbouring views do not overlap: take a smaller pitch or move the scene away"
        return Finding("bad", "disparity", text, remedy)
    if ONE_PLANE_PX <= spread_px < MIN_SPREAD_PX:
        return Finding("warn", "disparity", text, _wider_pitch(facts, MIN_APART_PX / spread_px))
    return Finding("ok", "disparity", text)


def _separation_findings(facts: Facts) -> list[Finding]:
    """Blur between the nearest two of the objects that are neighbours in depth, by their median depths."""
    ordered = sorted(facts.scored, key=lambda thing: thing.middle_mm)
    pairs = [(float(apart_px(facts.grid, a.middle_mm, b.middle_mm)), a, b) for a, b in pairwise(ordered)]
    pairs = [pair for pair in pairs if pair[0] >= ONE_PLANE_PX]
    if not pairs:
        return []
    blur_px, near, far = min(pairs, key=lambda pair: pair[0])
    text = (
        f"{near.name} ({near.middle_mm:.0f} mm) and {far.name} ({far.middle_mm:.0f} mm), the nearest two in "
        f"depth, are {blur_px:.2f} px of blur apart"
    )
    if blur_px >= MIN_APART_PX:
        return [Finding("ok", "separation", text)]
    inverse = 1 / near.middle_mm - MIN_APART_PX / spread_px_mm(facts.grid)
    remedy = _wider_pitch(facts, MIN_APART_PX / blur_px)
    if inverse > 0:
        remedy = f"move {far.name} {math.ceil(1 / inverse - far.middle_mm)} mm further away, or {remedy}"
    return [Finding("warn", "separation", text, remedy)]


def _wider_pitch(facts: Facts, factor: float) -> str:
    return f"take a pitch of {' x '.join(f'{pitch * factor:.3g}' for pitch in facts.grid.pitch_mm)} mm"


def _focus_findings(facts: Facts) -> list[Finding]:
    """The object that is least in focus, planes without objects, no planes at all, and the depth range."""
    planes, analysis, findings = facts.planes_mm, facts.target.recipe.analysis, []
    shares = np.array([[focus_share(facts, thing, z) for z in planes] for thing in facts.scored])
    best, names = shares.max(axis=1), listed([f"{z:g}" for z in planes])
    blurred = [f"{t.middle_mm:.0f}" for t, s in zip(facts.scored, best, strict=True) if s < MIN_FOCUS_SHARE]
    text = (
        f"of {facts.scored[best.argmin()].name}, the object least in focus, {best.min():.0%} is in focus at "
        f"the best of the planes {names} mm"
    )
    remedy = f"add {listed(blurred)} to analysis.z_mm" if blurred else ""
    findings.append(Finding("warn" if blurred else "ok", "focus", text, remedy))
    if not analysis.z_mm:
        text = "neither the scene nor the recipe names depths to look at, and pcii asks for --z-mm"
        findings.append(Finding("warn", "focus", text, f"add planes_mm = [{names}] to the scene"))
    elif (shares.max(axis=0) == 0).any():
        empty = listed([f"{z:g}" for z, share in zip(planes, shares.max(axis=0), strict=True) if not share])
        remedy = "take that from analysis.z_mm or move an object there"
        findings.append(Finding("warn", "focus", f"no object is in focus at {empty} mm", remedy))
    limits_mm, (near_mm, far_mm) = analysis.z_range_mm, _depths_of(facts.scored)
    if limits_mm is not None and not limits_mm[0] <= near_mm <= far_mm <= limits_mm[1]:
        text = f"depth maps look from {limits_mm[0]:g} to {limits_mm[1]:g} mm, where not all objects are"
        remedy = f"analysis.z_range_mm = [{math.floor(near_mm)}, {math.ceil(far_mm)}]"
        findings.append(Finding("warn", "focus", text, remedy))
    return findings


def focus_share(facts: Facts, thing: ObjectFacts, z_mm: float) -> float:
    """Share of what is seen of an object whose blur at the plane reaches at most `FOCUS_PX` to each side."""
    return float((apart_px(facts.grid, thing.z_mm, z_mm) / 2 <= FOCUS_PX).mean())


def _depths_of(things: Sequence[ObjectFacts]) -> tuple[float, float]:
    """The nearest and the farthest depth at which any of them is seen."""
    return float(min(t.z_mm.min() for t in things)), float(max(t.z_mm.max() for t in things))


def _overlap_finding(facts: Facts) -> Finding:
    """Share of the sections that every camera sees, where it is least."""
    share, plane_mm = min((share_seen_by_all(facts.grid, z), z) for z in facts.planes_mm)
    text = f"all {facts.grid.view_count} views see {share:.0%} of the section at {plane_mm:g} mm"
    if share >= MIN_OVERLAP:
        return Finding("ok", "overlap", text)
    return Finding("warn", "overlap", text, "take a smaller pitch, fewer cameras or a wider film")


def _colour_findings(facts: Facts) -> list[Finding]:
    """Planes at which the cameras' shifts leave voxels without one of the colours of the Bayer pattern."""
    grid, cfa = facts.grid, facts.target.recipe.sensor.bayer
    if cfa is None:
        return []
    shares = {z: shares_without(grid, cfa, z) for z in facts.planes_mm}
    lacking = {z: share for z, share in shares.items() if share.any()}
    if not lacking:
        return [Finding("ok", "colours", "every voxel has all three at all planes")]
    most = np.max(list(lacking.values()), axis=0)
    lacks = [f"{share:.0%} have no {name}" for share, name in zip(most, COLOURS, strict=True) if share]
    planes = listed([f"{z:g}" for z in lacking])
    text = f"of the voxels at {planes} mm {', '.join(lacks)}, as most shifts are even"
    pitch = mending_pitch_mm(grid, facts.planes_mm)
    remedy = f"take a pitch of {pitch[0]:g} x {pitch[1]:g} mm" if pitch else "set sensor.cfa = 'none'"
    return [Finding("warn", "colours", text, remedy)]


def _disparity(facts: Facts, z_mm: float) -> str:
    across_px, down_px = disparities_px(facts.grid, z_mm)
    if np.isclose(across_px, down_px):
        return f"{across_px:.2f} px"
    return f"{across_px:.2f} x {down_px:.2f} px"

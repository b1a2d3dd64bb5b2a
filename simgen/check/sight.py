"""Findings on what the cameras see and at which depth: objects that are cut or never seen, lamps, glass;
disparities, blur between objects, planes, overlap, colours that are missing."""

import math
from collections.abc import Iterable, Iterator, Sequence
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
from simgen.check.scene_probe import Facts, Finding, ObjectFacts
from simgen.spec import is_clear

MAX_MAGNIFICATION = 10.0
"""What stands nearer than the focal length divided by this is taken to be placed by mistake, as in metres."""
MIN_GLASS_DEPTH = 6
"""Segments of a path through the two sides of a ball to a surface, and on to a lamp by way of another."""
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


def sight_findings(facts: Facts) -> Iterator[Finding]:
    """Findings on objects, glass and lamps."""
    by_name = {thing.name: _object_finding(facts, thing) for thing in facts.objects}
    whole = [thing.name for thing in facts.visible_objects if by_name[thing.name] is None]
    if whole:
        yield Finding("ok", "objects", f"the centre and the corner cameras see {_listed(whole)}")
    yield from (finding for finding in by_name.values() if finding is not None)
    if not facts.objects:
        yield Finding("warn", "objects", "there are none", "add [[objects]] to the scene")
    scene, depth = facts.target.scene, facts.target.recipe.render.max_depth
    if scene.backdrop is not None and scene.backdrop.z_mm < _nearest_mm(facts):
        yield _too_near("backdrop", f"it is at z = {scene.backdrop.z_mm:g} mm")
    glass = [thing.name for thing in scene.objects if is_clear(thing.material.finish)]
    if glass and depth < MIN_GLASS_DEPTH:
        text = f"paths of {depth} segments end inside {_listed(glass)}, whose glass looks dark"
        yield Finding("warn", "glass", text, f"set render.max_depth to {MIN_GLASS_DEPTH} or more")
    for number in facts.lamps_away:
        text, remedy = f"lamp {number} shines away from every object", f"turn lights[{number - 1}].target_mm"
        yield Finding("warn", "lights", text, f"{remedy} to the objects")
    text = f"the picture's mean luminance is {facts.luminance:.3g} cd/m^2"
    if facts.luminance > 0:
        yield Finding("ok", "lights", text)
    else:
        yield Finding("bad", "lights", text, "point a lamp at the objects, or add a light of type 'uniform'")


def _object_finding(facts: Facts, thing: ObjectFacts) -> Finding | None:
    """What is wrong with how an object is seen; None if nothing is, or it is a lamp that no camera sees."""
    near_mm, far_mm = thing.body_z_mm
    is_around_cameras = near_mm <= 0 and thing.film_share == 1
    if is_around_cameras or far_mm < _nearest_mm(facts):
        return _too_near("objects", f"{thing.name} is at z = {near_mm:.3g} to {far_mm:.3g} mm")
    if not thing.corners_seeing and not thing.z_mm.size:
        if thing.shines:  # a lamp may stand where no camera sees it
            return None
        across_mm, down_mm = (px * facts.grid.pixel_mm / 2 for px in (facts.grid.width, facts.grid.height))
        per_mm = far_mm / facts.grid.focal_mm
        remedy = (
            f"move it from behind what hides it, or into view, which at {far_mm:.0f} mm reaches "
            f"{across_mm * per_mm:.0f} mm to either side and {down_mm * per_mm:.0f} mm up and down"
        )
        return Finding("bad", "objects", f"no camera sees {thing.name}", remedy)
    if not thing.z_mm.size:
        text = f"corner cameras see {thing.name}, but the virtual centre, of which the truth is, does not"
        return Finding("warn", "objects", text, "move it into view")
    if thing.corners_seeing_all < facts.corners and not thing.is_cut_at_centre:
        text = f"{thing.corners_seeing_all} of {facts.corners} corner cameras see all of {thing.name}"
        remedy = "move it to the middle, or take a smaller pitch or a wider film"
        return Finding("warn", "objects", text, remedy)
    return None


def _nearest_mm(facts: Facts) -> float:
    return facts.grid.focal_mm / MAX_MAGNIFICATION


def _too_near(subject: str, text: str) -> Finding:
    remedy = "Z runs forward in millimetres, not metres: give it a z of some hundred"
    return Finding("bad", subject, f"{text}, beside the cameras or behind them", remedy)


def depth_findings(facts: Facts) -> Iterator[Finding]:
    """Findings on depth; of a single camera, which has no disparity, one."""
    if facts.grid.view_count == 1:
        yield Finding("ok", "disparity", "one camera has none: depths cannot be told apart")
    elif facts.planes_mm:
        if facts.visible_objects:
            yield _disparity_finding(facts)
            yield from _separation_findings(facts)
        if facts.scored:
            yield from _focus_findings(facts)
        yield _overlap_finding(facts)
        yield from _colour_findings(facts)


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


def _separation_findings(facts: Facts) -> Iterator[Finding]:
    """Blur between the nearest two of the objects that are neighbours in depth, by their median depths."""
    ordered = sorted(facts.scored, key=lambda thing: thing.middle_mm)
    pairs = [(float(apart_px(facts.grid, a.middle_mm, b.middle_mm)), a, b) for a, b in pairwise(ordered)]
    pairs = [pair for pair in pairs if pair[0] >= ONE_PLANE_PX]
    if not pairs:
        return
    blur_px, near, far = min(pairs, key=lambda pair: pair[0])
    text = (
        f"{near.name} ({near.middle_mm:.0f} mm) and {far.name} ({far.middle_mm:.0f} mm), the nearest two in "
        f"depth, are {blur_px:.2f} px of blur apart"
    )
    if blur_px >= MIN_APART_PX:
        yield Finding("ok", "separation", text)
        return
    inverse = 1 / near.middle_mm - MIN_APART_PX / spread_px_mm(facts.grid)
    remedy = _wider_pitch(facts, MIN_APART_PX / blur_px)
    if inverse > 0:
        remedy = f"move {far.name} {math.ceil(1 / inverse - far.middle_mm)} mm further away, or {remedy}"
    yield Finding("warn", "separation", text, remedy)


def _wider_pitch(facts: Facts, factor: float) -> str:
    return f"take a pitch of {' x '.join(f'{pitch * factor:.3g}' for pitch in facts.grid.pitch_mm)} mm"


def _focus_findings(facts: Facts) -> Iterator[Finding]:
    """The object that is least in focus, planes without objects, no planes at all, and the depth range."""
    planes, analysis = np.array(facts.planes_mm), facts.target.recipe.analysis
    # (objects, planes): share of what is seen whose blur reaches at most `FOCUS_PX` to each side.
    shares = np.array(
        [
            (apart_px(facts.grid, thing.z_mm[:, None], planes) / 2 <= FOCUS_PX).mean(axis=0)
            for thing in facts.scored
        ]
    )
    best, in_planes, names = shares.max(axis=1), shares.max(axis=0), _in_mm(planes)
    blurred = [f"{t.middle_mm:.0f}" for t, s in zip(facts.scored, best, strict=True) if s < MIN_FOCUS_SHARE]
    text = (
        f"of {facts.scored[best.argmin()].name}, the object least in focus, {best.min():.0%} is in focus at "
        f"the best of the planes {names} mm"
    )
    remedy = f"add {_listed(blurred)} to analysis.z_mm" if blurred else ""
    yield Finding("warn" if blurred else "ok", "focus", text, remedy)
    if not analysis.z_mm:
        text = "neither the scene nor the recipe names depths to look at, and pcii asks for --z-mm"
        yield Finding("warn", "focus", text, f"add planes_mm = [{names}] to the scene")
    elif (in_planes == 0).any():
        text = f"no object is in focus at {_in_mm(planes[in_planes == 0])} mm"
        yield Finding("warn", "focus", text, "take that from analysis.z_mm or move an object there")
    limits_mm, (near_mm, far_mm) = analysis.z_range_mm, _depths_of(facts.scored)
    if limits_mm is not None and not limits_mm[0] <= near_mm <= far_mm <= limits_mm[1]:
        text = f"depth maps look from {limits_mm[0]:g} to {limits_mm[1]:g} mm, where not all objects are"
        remedy = f"analysis.z_range_mm = [{math.floor(near_mm)}, {math.ceil(far_mm)}]"
        yield Finding("warn", "focus", text, remedy)


def _in_mm(planes_mm: Iterable[float]) -> str:
    return _listed([f"{z:g}" for z in planes_mm])


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


def _colour_findings(facts: Facts) -> Iterator[Finding]:
    """Planes at which the cameras' shifts leave voxels without one of the colours of the Bayer pattern."""
    grid, cfa = facts.grid, facts.target.recipe.sensor.bayer
    if cfa is None:
        return
    shares = {z: shares_without(grid, cfa, z) for z in facts.planes_mm}
    lacking = {z: share for z, share in shares.items() if share.any()}
    if not lacking:
        yield Finding("ok", "colours", "every voxel has all three at all planes")
        return
    most = np.max(list(lacking.values()), axis=0)
    lacks = [f"{share:.0%} have no {name}" for share, name in zip(most, COLOURS, strict=True) if share]
    text = f"of the voxels at {_in_mm(lacking)} mm {', '.join(lacks)}, as most shifts are even"
    pitch = mending_pitch_mm(grid, facts.planes_mm)
    remedy = f"take a pitch of {pitch[0]:g} x {pitch[1]:g} mm" if pitch else "set sensor.cfa = 'none'"
    yield Finding("warn", "colours", text, remedy)


def _disparity(facts: Facts, z_mm: float) -> str:
    across_px, down_px = disparities_px(facts.grid, z_mm)
    if np.isclose(across_px, down_px):
        return f"{across_px:.2f} px"
    return f"{across_px:.2f} x {down_px:.2f} px"


def _listed(names: list[str], most: int = 6) -> str:
    """`a, b and 3 more`."""
    text = ", ".join(names[:most])
    return text if len(names) <= most else f"{text} and {len(names) - most} more"

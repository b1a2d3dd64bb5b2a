"""Findings on what the cameras see: objects that are cut or never seen, lamps, glass."""

from simgen.check.facts import Facts, Finding, ObjectFacts, listed
from simgen.spec import is_clear

MAX_MAGNIFICATION = 10.0
"""What stands nearer than the focal length divided by this is taken to be placed by mistake, as in metres."""
MIN_GLASS_DEPTH = 6
"""Segments of a path through the two sides of a ball to a surface, and on to a lamp by way of another."""


def sight_findings(facts: Facts) -> list[Finding]:
    """All findings of this file."""
    by_name = {thing.name: _object_findings(facts, thing) for thing in facts.objects}
    findings = [finding for of_object in by_name.values() for finding in of_object]
    whole = [thing.name for thing in facts.visible_objects if not by_name[thing.name]]
    if whole:
        findings.insert(0, Finding("ok", "objects", f"the centre and the corner cameras see {listed(whole)}"))
    if not facts.objects:
        findings.append(Finding("warn", "objects", "there are none", "add [[objects]] to the scene"))
    scene, depth = facts.target.scene, facts.target.recipe.render.max_depth
    if scene.backdrop is not None and scene.backdrop.z_mm < _nearest_mm(facts):
        findings.append(_too_near("backdrop", f"it is at z = {scene.backdrop.z_mm:g} mm"))
    glass = [thing.name for thing in scene.objects if is_clear(thing.material.finish)]
    if glass and depth < MIN_GLASS_DEPTH:
        text = f"paths of {depth} segments end inside {listed(glass)}, whose glass looks dark"
        findings.append(Finding("warn", "glass", text, f"set render.max_depth to {MIN_GLASS_DEPTH} or more"))
    for number in facts.lamps_away:
        text, remedy = f"lamp {number} shines away from every object", f"turn lights[{number - 1}].target_mm"
        findings.append(Finding("warn", "lights", text, f"{remedy} to the objects"))
    text = f"the picture's mean luminance is {facts.luminance:.3g} cd/m^2"
    if facts.luminance > 0:
        return [*findings, Finding("ok", "lights", text)]
    remedy = "point a lamp at the objects, or add a light of type 'uniform'"
    return [*findings, Finding("bad", "lights", text, remedy)]


def _object_findings(facts: Facts, thing: ObjectFacts) -> list[Finding]:
    near_mm, far_mm = thing.body_z_mm
    is_around_cameras = near_mm <= 0 and thing.film_share == 1
    if is_around_cameras or far_mm < _nearest_mm(facts):
        return [_too_near("objects", f"{thing.name} is at z = {near_mm:.3g} to {far_mm:.3g} mm")]
    if not thing.corners_seeing and not thing.z_mm.size:
        if thing.shines:  # a lamp may stand where no camera sees it
            return []
        across_mm, down_mm = (px * facts.grid.pixel_mm / 2 for px in (facts.grid.width, facts.grid.height))
        per_mm = far_mm / facts.grid.focal_mm
        remedy = (
            f"move it from behind what hides it, or into view, which at {far_mm:.0f} mm reaches "
            f"{across_mm * per_mm:.0f} mm to either side and {down_mm * per_mm:.0f} mm up and down"
        )
        return [Finding("bad", "objects", f"no camera sees {thing.name}", remedy)]
    if not thing.z_mm.size:
        text = f"corner cameras see {thing.name}, but the virtual centre, of which the truth is, does not"
        return [Finding("warn", "objects", text, "move it into view")]
    if thing.corners_seeing_all < facts.corners and not thing.is_cut_at_centre:
        text = f"{thing.corners_seeing_all} of {facts.corners} corner cameras see all of {thing.name}"
        remedy = "move it to the middle, or take a smaller pitch or a wider film"
        return [Finding("warn", "objects", text, remedy)]
    return []


def _nearest_mm(facts: Facts) -> float:
    return facts.grid.focal_mm / MAX_MAGNIFICATION


def _too_near(subject: str, text: str) -> Finding:
    remedy = "Z runs forward in millimetres, not metres: give it a z of some hundred"
    return Finding("bad", subject, f"{text}, beside the cameras or behind them", remedy)

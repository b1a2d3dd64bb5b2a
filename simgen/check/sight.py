"""Findings on what the cameras see: objects cut or never seen, cameras inside things, lamps."""

from simgen.check.scene_facts import Facts, Finding, ObjectFacts, listed
from simgen.renderer.mitsuba_camera import NEAR_CLIP_MM

MOST_MAGNIFIED = 10.0
"""What stands nearer than the focal length divided by this is so many times as large on the film."""
LEAST_GLASS_DEPTH = 6
"""Segments of a path through the two sides of a ball to a surface, and on to a lamp by way of another."""


def sight_findings(facts: Facts) -> list[Finding]:
    """All findings of this file."""
    findings_of = {thing.name: _object_findings(facts, thing) for thing in facts.objects}
    found = [finding for found_here in findings_of.values() for finding in found_here]
    whole = [name for name, found_here in findings_of.items() if not found_here]
    if whole:
        text = f"the virtual centre and the corner cameras see all of {listed(whole)}"
        found.insert(0, Finding("ok", "objects", text))
    if not facts.objects:
        found = [Finding("warn", "objects", "there are none", "add [[objects]] to the scene")]
    return found + _glass_findings(facts) + _wall_findings(facts) + _lamp_findings(facts)


def _object_findings(facts: Facts, thing: ObjectFacts) -> list[Finding]:
    name, found = thing.name, []
    if _surely_metres(facts, thing):
        text = f"{name} stands at z = {thing.stands_at_mm:g} mm, right before the cameras"
        return [Finding("bad", "objects", text, _in_millimetres(thing.stands_at_mm))]
    if thing.encloses_camera:
        return [Finding("bad", "objects", f"a camera stands inside {name}", f"move {name} away from Z = 0")]
    if not thing.z_mm.size and not thing.corners_seen and thing.shines:
        return [Finding("note", "objects", f"no camera sees {name}, which shines: it is a lamp")]
    if not thing.z_mm.size and not thing.corners_seen:
        return [Finding("bad", "objects", f"no camera sees {name}", _why_unseen(facts, thing))]
    if not thing.z_mm.size:
        text = (
            f"{thing.corners_seen} of {facts.corners} corner cameras see {name}, the virtual centre does not"
        )
        remedy = "truth and scores are the centre's: move it into view"
        found.append(Finding("warn", "objects", text, remedy))
    elif thing.corners_seen < facts.corners:
        text = f"{facts.corners - thing.corners_seen} of {facts.corners} corner cameras do not see {name}"
        found.append(Finding("warn", "objects", text, "move it to the middle or take a smaller pitch"))
    if thing.body_z_mm[0] <= 0:
        text = f"{name} reaches to z = {thing.body_z_mm[0]:.0f} mm, behind the cameras"
        found.append(Finding("warn", "objects", text, "what lies there is not seen; move it away"))
    return found + _cut(facts, thing)


def _cut(facts: Facts, thing: ObjectFacts) -> list[Finding]:
    if not thing.corners_cut:
        return []
    if thing.centre_cut:
        return [Finding("note", "objects", f"{thing.name} runs beyond the film, of the virtual centre too")]
    text = f"the film's border cuts {thing.name} in {thing.corners_cut} of {facts.corners} corner cameras"
    return [
        Finding("warn", "objects", text, "move it to the middle, or take a smaller pitch or a wider film")
    ]


def _why_unseen(facts: Facts, thing: ObjectFacts) -> str:
    near, far = thing.body_z_mm
    if far <= NEAR_CLIP_MM:
        flat = near >= -NEAR_CLIP_MM
        place = "in the plane of the cameras" if flat else f"behind the cameras (z up to {far:.0f} mm)"
        return f"it is {place}: Z runs forward, give it a z of some hundred millimetres"
    if near <= 0:
        return f"it reaches behind the cameras, to z = {near:g} mm: move it away"
    if facts.backdrop_mm is not None and near >= facts.backdrop_mm:
        return f"it is behind the backdrop at {facts.backdrop_mm:g} mm"
    if thing.on_film is None or not thing.on_film.in_view:
        across, down = (
            side * facts.grid.pixel_mm / facts.grid.focal_mm * near / 2
            for side in (facts.grid.width, facts.grid.height)
        )
        return (
            f"it is outside the field of view, which at {near:.0f} mm reaches {across:.0f} mm to either side "
            f"and {down:.0f} mm up and down"
        )
    return _too_small(facts, max(thing.on_film.size_px))


def _too_small(facts: Facts, size_px: float) -> str:
    if size_px < 1:
        return f"it is smaller than a pixel ({size_px:.2g} px): make it larger, or pixels smaller"
    coarse_px = max(facts.grid.height, facts.grid.width) / max(facts.probe_px)
    if size_px < 2 * coarse_px:
        return f"it is {size_px:.1f} px large, and this coarse look has pixels of {coarse_px:.1f} px"
    return "something hides it, or it is thinner than a pixel: move what stands before it, or turn it"


def _surely_metres(facts: Facts, thing: ObjectFacts) -> bool:
    """Whether an object is so near that its depth must be in metres: no camera magnifies so much."""
    near_mm = facts.grid.focal_mm / MOST_MAGNIFIED
    hardly_seen = not thing.z_mm.size or thing.encloses_camera or thing.body_z_mm[1] < near_mm
    return 0 < thing.stands_at_mm < near_mm and hardly_seen


def _in_millimetres(z_mm: float) -> str:
    """What to say of a depth that must be in metres."""
    return f"did you mean {1000 * z_mm:g} mm? lengths are in millimetres"


def _glass_findings(facts: Facts) -> list[Finding]:
    depth = facts.render.max_depth
    if not facts.glass or depth >= LEAST_GLASS_DEPTH:
        return []
    text = f"{listed(list(facts.glass))}: paths of {depth} segments end inside glass, which looks dark"
    return [Finding("warn", "glass", text, f"set render.max_depth to {LEAST_GLASS_DEPTH} or more")]


def _wall_findings(facts: Facts) -> list[Finding]:
    wall = facts.backdrop_mm
    if wall is None or wall >= facts.grid.focal_mm / MOST_MAGNIFIED:
        return []
    if wall > NEAR_CLIP_MM:
        text = f"it stands at z = {wall:g} mm, right before the cameras"
        return [Finding("bad", "backdrop", text, _in_millimetres(wall))]
    text = f"the backdrop stands at {wall:g} mm, in the plane of the cameras"
    return [Finding("bad", "backdrop", text, "give it a z_mm behind the objects")]


def _level_findings(facts: Facts) -> list[Finding]:
    level, wall = facts.level, facts.backdrop_mm
    if level is None:
        return []
    text = f"{level.illuminance_lux:g} lux at {level.z_mm:g} mm: lights are {facts.gain:.3g} x what they say"
    if wall is not None and level.z_mm > wall:
        remedy = "set level.z_mm to where the objects are"
        return [Finding("warn", "lights", f"{text}; that is behind the backdrop", remedy)]
    return [Finding("ok", "lights", text)]


def _lamp_findings(facts: Facts) -> list[Finding]:
    found = _level_findings(facts)
    for number in facts.lamps_away:
        text = f"lamp {number} shines away from every object"
        found.append(Finding("warn", "lights", text, f"turn lights[{number - 1}].target_mm to the objects"))
    if facts.luminance <= 0:
        remedy = "point a lamp at the objects, or add a light of type 'uniform'"
        found.append(Finding("bad", "lights", "no light comes from what the cameras see", remedy))
    elif not found:
        unit = "cd/m^2, as the camera's pixels see it" if facts.sensor.is_spectral else "cd/m^2"
        text = f"the picture's mean luminance is {facts.luminance:.3g} {unit}"
        found.append(Finding("ok", "lights", text))
    return found

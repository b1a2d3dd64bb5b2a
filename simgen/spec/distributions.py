"""Scenes as distributions: a scene.toml of which every number gives a plain scene, the same for all time.

Numbers, vectors, colours, materials, patterns and how many objects there are may be drawn, and objects may
be placed apart from each other or on a box; docs/scenes.md has the language. Random streams are keyed by
names of objects and fields, so that an edit elsewhere in the file changes nothing here.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from pcii.base.errors import InputError
from simgen.base.strict_models import Position, Strict, Vector, shown_value, suggestion, validate
from simgen.spec.bodies import Body, body_of
from simgen.spec.drawn_values import Drawing, Place, holds_draws, is_number, is_whole
from simgen.spec.shapes import Box, Shape

MOST_COPIES = 1000
MOST_TRIES = 1000
"""So often a place is drawn for an object that must keep away from others."""
HEIGHT_DIGITS = 6
"""Decimals, in mm, of the height of what stands on something."""
PLACEMENT_KEYS = ("apart_mm", "on")
TEMPLATE_KEYS = ("count", "placement")
"""What an object of a distribution can have that one of a scene cannot."""

Table = dict[str, Any]


class Solid(Strict):
    """What decides how far an object reaches."""

    position_mm: Position
    rotation_deg: Vector = (0.0, 0.0, 0.0)
    shape: Shape


def is_distribution(values: Table) -> bool:
    """Whether a scene file is a distribution of scenes, and not one scene."""
    objects = values.get("objects")
    templates = objects if isinstance(objects, list) else []
    has_templates = any(
        key in table for table in templates if isinstance(table, dict) for key in TEMPLATE_KEYS
    )
    try:
        return "variables" in values or has_templates or holds_draws(values)
    except RecursionError:  # what is nested so deeply is no scene either, as its validation says
        return False


def draw(values: Table, number: int, source: str) -> Table:
    """The plain scene of a number, as TOML values.

    Raises `InputError` that begins with `source` and names the field: for what is not in the language, for
    variables that are not known, for objects that find no place.
    """
    drawing = Drawing(number, source)
    try:
        drawing.define(values.get("variables", {}))
        plain = {
            key: drawing.value(value, Place(key, (key,)))
            for key, value in values.items()
            if key not in ("variables", "objects")
        }
        if "objects" in values:
            plain["objects"] = _objects(drawing, values["objects"])
    except RecursionError:
        raise InputError(f"{source}: its arrays or tables are nested too deeply") from None
    return plain


def _objects(drawing: Drawing, given: Any) -> list[Table]:
    """All copies of all objects, in order."""
    if not isinstance(given, list):
        drawing.refuse(Place("objects", ()), f"expected [[objects]], got {shown_value(given)}")
    made: dict[str, Table] = {}
    placed: list[Body] = []
    names = set[str]()
    for position, table in enumerate(given):
        shown = f"objects[{position}]"
        if not isinstance(table, dict) or not isinstance(table.get("name"), str):
            drawing.refuse(Place(shown, ()), "expected a table with a name, which cannot be drawn")
        place = Place(shown, ("objects", table["name"]))
        if table["name"] in names:
            drawing.refuse(place["name"], f"two objects are named {shown_value(table['name'])}")
        names.add(table["name"])
        for name, copy in _copies(drawing, table, place):
            if name in made:
                drawing.refuse(place["name"], f"two objects are named {shown_value(name)}")
            made[name] = _copy(drawing, name, table, copy, placed, made)
    return list(made.values())


def _copies(drawing: Drawing, table: Table, place: Place) -> Iterator[tuple[str, Place]]:
    """Name and place of each copy of an object: the object itself unless it has a count."""
    if "count" not in table:
        yield table["name"], place
        return
    count = drawing.value(table["count"], place["count"])
    if not is_whole(count) or not 0 <= count <= MOST_COPIES:
        drawing.refuse(
            place["count"], f"expected a whole number from 0 to {MOST_COPIES}, got {shown_value(count)}"
        )
    for copy in range(1, count + 1):
        yield f"{table['name']}-{copy}", replace(place, key=(*place.key, copy))


def _copy(
    drawing: Drawing, name: str, table: Table, place: Place, placed: list[Body], made: dict[str, Table]
) -> Table:
    """One copy of an object, drawn; its body is added to those `placed`."""
    plain = {"name": name} | {
        key: drawing.value(value, place[key])
        for key, value in table.items()
        if key not in ("name", *TEMPLATE_KEYS)
    }
    if "placement" not in table:
        return plain
    apart_mm, top_mm = _placement(drawing, table["placement"], place["placement"], made)
    for attempt in range(MOST_TRIES):
        for key in ("position_mm", "rotation_deg"):
            if attempt and key in table:
                plain[key] = drawing.again(table[key], place[key], attempt)
        body = _body(drawing, plain, place)
        if top_mm is not None:
            x, _, z = body.centre_mm
            body = replace(body, centre_mm=(x, round(top_mm - body.reach_mm[1], HEIGHT_DIGITS), z))
            plain["position_mm"] = list(body.centre_mm)
        if all(_gap_mm(body, other) >= apart_mm for other in placed):
            placed.append(body)
            return plain
    drawing.refuse(
        place["placement"],
        f"in draw {drawing.number} {MOST_TRIES} tries found no place {apart_mm:g} mm apart from others for "
        f"'{name}'; make the objects fewer or smaller, or the room for them larger",
    )


def _placement(
    drawing: Drawing, given: Any, place: Place, made: dict[str, Table]
) -> tuple[float, float | None]:
    """How far from others an object keeps, -inf if it may overlap; and the Y of what it stands on."""
    values = drawing.value(given, place)
    if not isinstance(values, dict) or not values:
        drawing.refuse(place, f"expected a table such as {{ apart_mm = 5.0 }}, got {shown_value(values)}")
    unknown = [key for key in values if key not in PLACEMENT_KEYS]
    if unknown:
        drawing.refuse(place, f"unknown key '{unknown[0]}'{suggestion(unknown[0], PLACEMENT_KEYS)}")
    apart_mm, support = values.get("apart_mm", 0), values.get("on")
    if not (is_number(apart_mm) and apart_mm >= 0):
        drawing.refuse(place["apart_mm"], f"expected a number >= 0, got {shown_value(apart_mm)}")
    if "apart_mm" not in values:
        apart_mm = -math.inf
    if "on" not in values:
        return apart_mm, None
    if not isinstance(support, str) or support not in made:
        known = suggestion(support, made) if isinstance(support, str) else ""
        drawing.refuse(place["on"], f"there is no object {shown_value(support)} before this one{known}")
    shape = made[support].get("shape")
    if not isinstance(shape, dict) or shape.get("type") != Box.model_fields["type"].default:
        drawing.refuse(place["on"], f"'{support}' is no box, and only on boxes objects can stand")
    body = _body(drawing, made[support], Place(f"object '{support}'", ()))
    return apart_mm, body.centre_mm[1] - body.reach_mm[1]


def _body(drawing: Drawing, plain: Table, place: Place) -> Body:
    values = {key: plain[key] for key in Solid.model_fields if key in plain}
    solid = validate(Solid, values, f"{drawing.source}, draw {drawing.number}: {place.shown}")
    body = body_of(solid.shape, solid.position_mm, solid.rotation_deg)
    if body is None:
        raise InputError(
            f"{drawing.source}: {place.shown}.placement: it is for spheres, boxes, cylinders and cards, "
            "and this object is a mesh"
        )
    return body


def _gap_mm(one: Body, other: Body) -> float:
    """Between the bounding spheres."""
    return math.dist(one.centre_mm, other.centre_mm) - one.radius_mm - other.radius_mm

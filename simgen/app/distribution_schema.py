"""The JSON Schema of scene files: that of one scene, and a distribution wherever a value may be drawn."""

from collections.abc import Collection
from typing import Any

from simgen.base.strict_models import schema_of
from simgen.spec.distributions import MOST_COPIES
from simgen.spec.drawn_values import KINDS, NUMBER_KINDS
from simgen.spec.scene import Scene

Schema = dict[str, Any]

NEVER_DRAWN = {"Scene": {"title", "description", "objects"}, "SceneObject": {"name"}}
"""Fields that are what they are; `type` is another, wherever there is one."""
DISTRIBUTION: Schema = {"$ref": "#/$defs/Distribution"}


def scene_schema() -> Schema:
    """The JSON Schema of a scene.toml, of one scene or of a distribution of scenes."""
    schema = _with_distributions(schema_of(Scene), NEVER_DRAWN["Scene"])
    definitions = {
        name: _with_distributions(table, NEVER_DRAWN.get(name, set()))
        for name, table in schema["$defs"].items()
    }
    definitions["SceneObject"]["properties"] |= {
        "count": {
            "anyOf": [{"type": "integer", "minimum": 0, "maximum": MOST_COPIES}, DISTRIBUTION],
            "description": "How many there are, each drawn by itself and named by number: leaf-1, leaf-2.",
        },
        "placement": {
            "type": "object",
            "properties": {
                "apart_mm": {
                    "anyOf": [{"type": "number", "minimum": 0}, DISTRIBUTION],
                    "description": "Its place is drawn until it keeps so far from all placed before it.",
                },
                "on": {
                    "anyOf": [{"type": "string"}, DISTRIBUTION],
                    "description": "Name of a box further up, on whose top it stands.",
                },
            },
            "additionalProperties": False,
            "minProperties": 1,
            "description": "Where it may stand.",
        },
    }
    schema["properties"]["variables"] = {
        "type": "object",
        "description": "Values that are drawn once for a scene, in order; each may use those before it.",
    }
    return schema | {"$defs": definitions | {"Distribution": _distribution()}}


def _distribution() -> Schema:
    """Any of the tables that stand for a drawn value."""
    number_or_list = {"anyOf": [{"type": "number"}, {"type": "array", "items": {"type": "number"}}]}
    bounds = {"type": "array", "items": number_or_list, "minItems": 2, "maxItems": 2}
    values: dict[str, Schema] = {
        **{kind: bounds | {"description": f"{kind}: {rule.expected}"} for kind, rule in NUMBER_KINDS.items()},
        "choice": {
            "type": "array",
            "minItems": 1,
            "description": "one of these, which may be drawn themselves",
        },
        "variable": {"type": "string", "description": "name of one of the table [variables]"},
    }
    beside: dict[str, Schema] = {
        "weights": {"type": "array", "items": {"type": "number", "minimum": 0}},
        "times": {"anyOf": [number_or_list, DISTRIBUTION]},
        "plus": {"anyOf": [number_or_list, DISTRIBUTION]},
        "item": {"anyOf": [{"type": "integer", "minimum": 0}, DISTRIBUTION]},
    }
    return {
        "description": "A value that is drawn.",
        "oneOf": [
            {
                "type": "object",
                "properties": {kind: values[kind]} | {key: beside[key] for key in KINDS[kind]},
                "required": [kind],
                "additionalProperties": False,
            }
            for kind in KINDS
        ],
    }


def _with_distributions(schema: Schema, never_drawn: Collection[str] = ()) -> Schema:
    """A schema in which every item and every field, but for some, may be a distribution."""
    made = dict(schema)
    for key in ("anyOf", "oneOf"):
        if key in schema:
            made[key] = [_with_distributions(part) for part in schema[key]]
    if "properties" in schema:
        made["properties"] = {
            name: field if name in never_drawn or "const" in field else _or_distribution(field)
            for name, field in schema["properties"].items()
        }
    if isinstance(schema.get("items"), dict):
        made["items"] = _or_distribution(schema["items"])
    if "prefixItems" in schema:
        made["prefixItems"] = [_or_distribution(part) for part in schema["prefixItems"]]
    return made


def _or_distribution(schema: Schema) -> Schema:
    """Either of the two; what it is for stays where editors look."""
    told = {key: schema[key] for key in ("title", "description", "default") if key in schema}
    plain = {key: value for key, value in schema.items() if key not in told}
    return told | {"anyOf": [_with_distributions(plain), DISTRIBUTION]}

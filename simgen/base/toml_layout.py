"""Strict models as TOML that a person can read and edit: what `read_toml` and `validate` give back."""

import json
from collections.abc import Iterator, Sequence
from typing import Any, get_args

from pydantic import BaseModel

from simgen.base.strict_models import Strict


def toml_text(model: Strict, comments: Sequence[str] = ()) -> str:
    """A scene or another model as TOML that gives an equal one: `[[objects]]` for lists of models, `[level]`
    for one, and what lies deeper in the line, as `shape = { type = "sphere", radius_mm = 40.0 }`.

    Fields at their defaults are left out, but for the `type` of a table. `comments` are lines at the top.
    """
    fields = dict(_written(model))
    tables = {name: value for name, value in fields.items() if _makes_tables(value)}
    head = [f"# {_printable(line)}".rstrip() for text in comments for line in text.splitlines() or [""]]
    blocks = [head, _lines({name: value for name, value in fields.items() if name not in tables})]
    for name, value in tables.items():
        if isinstance(value, BaseModel):
            blocks.append([f"[{name}]", *_lines(dict(_written(value)))])
        else:
            blocks += [[f"[[{name}]]", *_lines(dict(_written(part)))] for part in value]
    return "\n".join("".join(f"{line}\n" for line in block) for block in blocks if block)


def _written(model: BaseModel) -> Iterator[tuple[str, Any]]:
    """Name and value of the fields that have to be written; by its `type` a reader tells what a table is."""
    for name, field in sorted(type(model).model_fields.items(), key=lambda item: item[0] != "type"):
        value = getattr(model, name)
        is_tag = name == "type" and len(get_args(field.annotation)) == 1
        # Compared as they are shown: -0.0 is not 0.0.
        if value is not None and (is_tag or repr(value) != repr(field.default)):
            yield name, value


def _makes_tables(value: Any) -> bool:
    models = value if isinstance(value, tuple) and value else (value,)
    return all(isinstance(part, BaseModel) for part in models)


def _lines(fields: dict[str, Any]) -> list[str]:
    return [
        f"{name} = {_paragraphs(value) if isinstance(value, str) else _value(value)}"
        for name, value in fields.items()
    ]


def _value(value: Any) -> str:
    """A value in one line."""
    if isinstance(value, BaseModel):
        return f"{{ {', '.join(f'{name} = {_value(part)}' for name, part in _written(value))} }}"
    if isinstance(value, tuple):
        return f"[{', '.join(_value(part) for part in value)}]"
    if isinstance(value, str):
        return f'"{_escaped(value)}"'
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _paragraphs(text: str) -> str:
    """A string that keeps its lines."""
    if "\n" not in text:
        return _value(text)
    lines = "\n".join(_escaped(line) for line in text.split("\n"))
    return f'"""\n{lines}"""'


def _escaped(text: str) -> str:
    """What stands between the quotation marks: TOML has JSON's escapes, and one for DEL."""
    return json.dumps(text, ensure_ascii=False)[1:-1].replace("\x7f", "\\u007f")


def _printable(line: str) -> str:
    return "".join(letter if letter.isprintable() else " " for letter in line)

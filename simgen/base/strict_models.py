"""What scene and recipe files share: strict models, how they are read and written as TOML, and faults that
name the field."""

import ast
import difflib
import inspect
import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from pcii.base import InputError

LARGEST_TOML_BYTES = 1 << 19
LONGEST_PART = 80
MOST_FAULTS = 20
"""Largest number of faults that one error lists."""


def _describe_fields(schema: dict[str, Any], model: type[BaseModel]) -> None:
    """Put the texts below the fields of a class into its JSON Schema.

    Pydantic's `use_attribute_docstrings` reads them when a class is made, which is slow and seldom needed.
    """
    for base in model.__mro__:
        if issubclass(base, Strict):
            (tree,) = ast.parse(inspect.getsource(base)).body
            for pair in pairwise(tree.body if isinstance(tree, ast.ClassDef) else ()):
                match pair:
                    case ast.AnnAssign(target=ast.Name(name)), ast.Expr(ast.Constant(str(text))):
                        schema["properties"][name].setdefault("description", inspect.cleandoc(text))


class Strict(BaseModel):
    """Frozen; an unknown key, NaN or infinity is an error: `InputError`, for whoever makes one in Python."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, json_schema_extra=_describe_fields
    )

    def __init__(self, /, **values: Any) -> None:
        with _as_input_errors(type(self).__name__, values):
            super().__init__(**values)

    # So pydantic validates a table within another without a call of it, and faults keep their place.
    __init__.__pydantic_base_init__ = True  # pyright: ignore[reportFunctionMemberAccess]

    def __setattr__(self, name: str, value: Any) -> None:
        with _as_input_errors(type(self).__name__, {name: value}):
            super().__setattr__(name, value)

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown_keys(cls, values: Any) -> Any:
        # Before pydantic does, which does not say what would be right.
        known = set(cls.model_fields)
        unknown = [key for key in values if key not in known] if isinstance(values, Mapping) else []
        if unknown:
            raise PydanticCustomError("unknown_keys", "unknown", {"unknown": unknown, "known": known})
        return values

    def change(self, **fields: Any) -> Self:
        """A copy with other values of these fields, checked as a new one is."""
        return type(self)(**{name: getattr(self, name) for name in self.model_fields_set} | fields)


Model = TypeVar("Model", bound=BaseModel)
# Numbers are numbers: `true` is not 1, nor is "1".
Real = Annotated[float, Field(strict=True)]
Whole = Annotated[int, Field(strict=True)]
Positive = Annotated[Real, Field(gt=0)]
NonNegative = Annotated[Real, Field(ge=0)]
Share = Annotated[Real, Field(ge=0, le=1)]
Count = Annotated[Whole, Field(ge=1)]
Vector = tuple[Real, Real, Real]
LARGEST_MM = 1e6
"""Lengths are a nanometre to a kilometre: products of several are still numbers in single precision."""
Length = Annotated[Real, Field(ge=1e-6, le=LARGEST_MM)]
Coordinate = Annotated[Real, Field(ge=-LARGEST_MM, le=LARGEST_MM)]
Position = tuple[Coordinate, Coordinate, Coordinate]
Colour = Annotated[tuple[Share, Share, Share], Field(description="sRGB, three numbers from 0 to 1")]


def _has_a_length(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    if not 1e-6 <= max(map(abs, direction)) <= 1e6:  # single precision can square these
        raise ValueError(f"the largest number of a direction must be 1e-6 to 1e6 in size, got {direction}")
    return direction


Direction = Annotated[Vector, AfterValidator(_has_a_length)]
"""A direction, whose length does not matter."""


def _one_line(title: str) -> str:
    if re.search(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]", title):
        raise ValueError(f"a title is one line without control characters, not {shown_value(title)}")
    return title


Title = Annotated[str, Field(max_length=200), AfterValidator(_one_line)]


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file as a dict; `InputError` if it is missing, too large or not TOML."""
    if not path.is_file():  # a pipe would block
        raise InputError(f"{path}: there is no such file")
    if path.stat().st_size > LARGEST_TOML_BYTES:
        raise InputError(f"{path}: a TOML file here may have {LARGEST_TOML_BYTES} bytes, and this has more")
    try:
        return tomllib.loads(path.read_bytes().decode())
    except (ValueError, RecursionError) as fault:
        raise InputError(f"{path}: not valid TOML: {shorten(str(fault))}") from None


def toml_text(model: Strict, comments: Sequence[str] = ()) -> str:
    """A scene or another model as TOML that gives an equal one: `[[objects]]` for lists of models, `[level]`
    for one, and what lies deeper in the line, as `shape = { type = "sphere", radius_mm = 40.0 }`.

    Fields at their defaults are left out, except for the `type` of a table. `comments` are lines at the top.
    """
    head = [f"# {_printable(line)}".rstrip() for text in comments for line in text.splitlines() or [""]]
    values: list[str] = []
    tables: list[list[str]] = []
    for name, value in _written_fields(model):
        parts, title = (value, f"[[{name}]]") if isinstance(value, tuple) else ((value,), f"[{name}]")
        if all(isinstance(part, BaseModel) for part in parts):
            tables += [[title, *(_line(*field) for field in _written_fields(part))] for part in parts]
        else:
            values.append(_line(name, value))
    return "\n".join("".join(f"{line}\n" for line in block) for block in (head, values, *tables) if block)


def _written_fields(model: BaseModel) -> Iterator[tuple[str, Any]]:
    """Name and value of the fields that have to be written, the `type` first, which tells tables apart."""
    for name, field in sorted(type(model).model_fields.items(), key=lambda item: item[0] != "type"):
        value = getattr(model, name)
        is_tag = name == "type" and len(get_args(field.annotation)) == 1
        # Compared as they are shown: -0.0 is not 0.0.
        if value is not None and (is_tag or repr(value) != repr(field.default)):
            yield name, value


def _line(name: str, value: Any) -> str:
    """A field on one line, or on several if it is a string that has several."""
    if isinstance(value, str) and "\n" in value:
        text = "\n".join(_inline(line)[1:-1] for line in value.split("\n"))
        return f'{name} = """\n{text}"""'
    return f"{name} = {_inline(value)}"


def _inline(value: Any) -> str:
    if isinstance(value, BaseModel):
        return f"{{ {', '.join(f'{name} = {_inline(part)}' for name, part in _written_fields(value))} }}"
    if isinstance(value, tuple):
        return f"[{', '.join(_inline(part) for part in value)}]"
    if isinstance(value, str):  # TOML has JSON's escapes, and one for DEL
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return str(value).lower() if isinstance(value, bool) else repr(value)


def validate(model: type[Model], values: Mapping[str, Any], source: str) -> Model:
    """A model of the values, which errors call `source`; `InputError` with a sentence for each fault."""
    with _as_input_errors(source, values):
        return model.model_validate(values)


@contextmanager
def _as_input_errors(source: str, values: Mapping[str, Any]) -> Iterator[None]:
    """Raise what pydantic finds wrong as `InputError`: the first fault in its text, others as notes."""
    try:
        yield
    except ValidationError as invalid:
        # Unknown keys come first: they are often why others are missing.
        errors = sorted(invalid.errors(include_url=False), key=lambda error: error["type"] != "unknown_keys")
        sentences = [shorten(text) for error in errors for text in _sentences(error, values)]
        more = f" (and {len(sentences) - 1} more)" if sentences[1:] else ""
        fault = InputError(f"{source}: {sentences[0]}{more}")
        for sentence in sentences[1:MOST_FAULTS]:
            fault.add_note(f"  {sentence}")
        raise fault from None


def _sentences(error: ErrorDetails, values: Mapping[str, Any]) -> list[str]:
    """A sentence about one error or, of unknown keys, about each."""
    kind, context = error["type"], error.get("ctx", {})
    where = _field(error["loc"], values, is_missing=kind == "missing")
    if kind == "unknown_keys":
        table, known = f"{where}." if where else "", context["known"]
        return [f"unknown key '{table}{key}'{suggestion(str(key), known)}" for key in context["unknown"]]
    if kind in ("missing", "union_tag_not_found"):
        return [f"'{where}{'.type' * (kind != 'missing')}' is missing"]
    if kind == "union_tag_invalid":
        types = re.findall(r"'(.*?)'", context["expected_tags"])
        return [f"'{where}.type': there is no {context['tag']!r}{suggestion(context['tag'], types)}"]
    field = f"'{where}': " if where else ""
    if kind == "value_error":
        return [f"{field}{context['error']}"]
    message = error["msg"][0].lower() + error["msg"][1:]
    return [f"{field}{message}, got {shown_value(error['input'])}"]


def _field(location: Sequence[int | str], values: Any, *, is_missing: bool) -> str:
    """`objects[1].shape.radius_mm`: pydantic's location, without the types of tables that it has beside keys.

    Keys and places in lists are those of the `values`; the last one is not there if it `is_missing`.
    """
    text = ""
    for number, part in enumerate(location, start=1):
        items: Any = dict(enumerate(values)) if isinstance(values, list | tuple) else values
        is_there = isinstance(items, Mapping) and part in items
        if is_there:
            values = items[part]
        if is_there or (is_missing and number == len(location)):
            text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def shorten(text: str, longest: int = 400) -> str:
    """One line fit for a terminal: without control characters, and with its middle left out if long."""
    if len(text) > longest:
        text = f"{text[: longest * 3 // 4]}...{text[-longest // 4 :]}"
    return _printable(text)


def _printable(text: str) -> str:
    return "".join(letter if letter.isprintable() else " " for letter in text)


def shown_value(value: Any) -> str:
    """A TOML value as an error shows it."""
    return str(value).lower() if isinstance(value, bool) else shorten(repr(value), LONGEST_PART)


def suggestion(word: str, known: Iterable[str]) -> str:
    """'; did you mean ...?' for the nearest known word, else the list of what is known."""
    words = sorted(known)
    near = difflib.get_close_matches(word[:LONGEST_PART], words, n=1)
    if near:
        return f"; did you mean '{near[0]}'?"
    return f"; known are {', '.join(words)}" if words else ""

"""What scene and recipe files share: strict models, TOML, and errors that point at the field."""

import difflib
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Tag, ValidationError

from pcii.base.errors import InputError

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

LARGEST_TOML_BYTES = 1 << 19
LONGEST_PART = 80
LONGEST_SENTENCE = 400
MOST_FAULTS = 20
"""An error tells so many faults of a file."""
MOST_KEY_PARTS = 32
# tomllib's time grows with the square of the parts of one key, so such keys are looked for first.
_LONG_KEY = re.compile(
    rb"(?:(?<![A-Za-z0-9_-])(?:[A-Za-z0-9_-]++|\"[^\"\n]*+\"|'[^'\n]*+')[ \t]*+\.[ \t]*+){%d}"
    % MOST_KEY_PARTS
)


_IN_TOML = {
    "a valid tuple": "a list in brackets",
    "a valid dictionary or object to extract fields from": 'a table such as { type = "..." }',
    "a valid dictionary or instance of": "a table, as of",
    "instance is frozen": "this is frozen, and change() gives a copy",
}
"""What pydantic calls things, and what they are to whoever writes TOML or Python."""


class Strict(BaseModel):
    """Frozen; an unknown key, NaN or infinity is an error: `InputError`, for whoever makes one in Python."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True)

    def __init__(self, /, **values: Any) -> None:
        with _as_input_errors(type(self), type(self).__name__):
            super().__init__(**values)

    # So pydantic validates a table within another without a call of it, and faults keep their place.
    __init__.__pydantic_base_init__ = True  # pyright: ignore[reportFunctionMemberAccess]

    def __setattr__(self, name: str, value: Any) -> None:
        with _as_input_errors(type(self), type(self).__name__):
            super().__setattr__(name, value)

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
SMALLEST_MM = 1e-6
LARGEST_MM = 1e6
"""Lengths are a nanometre to a kilometre: products of several still are numbers in single precision."""
Length = Annotated[Real, Field(ge=SMALLEST_MM, le=LARGEST_MM)]
Coordinate = Annotated[Real, Field(ge=-LARGEST_MM, le=LARGEST_MM)]
Position = tuple[Coordinate, Coordinate, Coordinate]
LARGEST_COMPONENT = 1e6


def _has_a_length(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    least = 1 / LARGEST_COMPONENT
    if not least <= max(map(abs, direction)) <= LARGEST_COMPONENT:
        raise ValueError(
            f"the largest number of a direction must be {least:g} to {LARGEST_COMPONENT:g} in size, "
            f"as in (0, 0, 1), got {direction}"
        )
    return direction


Direction = Annotated[Vector, AfterValidator(_has_a_length)]
"""A direction, whose length is of no matter within what single precision can square."""
LINE = r"^[^\x00-\x1f\x7f-\x9f\u2028\u2029]*$"


def _one_line(title: str) -> str:
    if not re.fullmatch(LINE, title):
        raise ValueError(f"a title is one line without control characters, not {shown_value(title)}")
    return title


Title = Annotated[str, Field(max_length=200, json_schema_extra={"pattern": LINE}), AfterValidator(_one_line)]
Colour = Annotated[tuple[Share, Share, Share], Field(description="sRGB, three numbers from 0 to 1")]


def completed_by(key: Literal["enum", "examples"], names: Callable[[], list[str]]) -> Callable[[Any], None]:
    """Puts names, looked up when it is asked for, into a field's JSON Schema: what editors complete."""

    def add(schema: dict[str, Any]) -> None:
        schema[key] = names()

    return add


def schema_of(model: type[BaseModel]) -> dict[str, Any]:
    """The JSON Schema of a model's files; by its `type` an editor tells which of several tables is meant."""
    schema = model.model_json_schema()
    for table in schema.get("$defs", {}).values():
        if "const" in table.get("properties", {}).get("type", {}):
            table["required"] = ["type", *table.get("required", [])]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | schema


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file as a dict; `InputError` if it is missing, too large or not TOML."""
    if path.is_dir():
        raise InputError(f"{path}: this is a folder, not a TOML file")
    if not path.is_file():  # nor a pipe, which would block
        raise InputError(f"{path}: there is no such file")
    with path.open("rb") as file:
        content = file.read(LARGEST_TOML_BYTES + 1)
    if len(content) > LARGEST_TOML_BYTES:
        raise InputError(f"{path}: a TOML file here may have {LARGEST_TOML_BYTES} bytes, and this has more")
    if _LONG_KEY.search(content):
        raise InputError(f"{path}: not valid TOML: a key of more than {MOST_KEY_PARTS} parts")
    try:
        return tomllib.loads(content.decode())
    except RecursionError:
        raise InputError(f"{path}: its arrays or tables are nested too deeply") from None
    except ValueError as fault:  # of tomllib, of UTF-8, of a number of thousands of digits
        raise InputError(f"{path}: not valid TOML: {shorten(str(fault))}") from None


def validate(
    model: type[Model], values: Mapping[str, Any], source: str, context: dict[str, Any] | None = None
) -> Model:
    """Build a model, or raise `InputError` that tells each fault in a sentence with field and remedy.

    `context` is what its validators are given.
    """
    with _as_input_errors(model, source):
        return model.model_validate(values, context=context)


@contextmanager
def _as_input_errors(model: type[BaseModel], source: str) -> Iterator[None]:
    """Raises what pydantic finds wrong with values of a model as `InputError`."""
    try:
        yield
    except ValidationError as fault:
        raise faults_of(source, *_sentences(model, fault)) from None
    except RecursionError:
        raise InputError(f"{source}: its arrays or tables are nested too deeply") from None


def faults_of(source: str, sentences: Sequence[str], number: int) -> InputError:
    """An error that tells a `number` of faults of a file: the first in its text, the next as notes.

    The first `MOST_FAULTS` of `sentences` are listed, each in one line.
    """
    first, *others = (shorten(sentence) for sentence in sentences[:MOST_FAULTS])
    fault = InputError(f"{source}: {first}" + (f" (and {number - 1} more)" if number > 1 else ""))
    for other in others:
        fault.add_note(f"  {other}")
    return fault


def shorten(text: str, longest: int = LONGEST_SENTENCE) -> str:
    """One line fit for a terminal: without control characters, and with its middle left out if long."""
    if len(text) > longest:
        text = f"{text[: longest * 3 // 4]}...{text[-longest // 4 :]}"
    return "".join(letter if letter.isprintable() else " " for letter in text)


def shown_value(value: Any) -> str:
    """A TOML value as an error shows it, however large it is."""
    if isinstance(value, bool):
        return str(value).lower()
    try:
        # A large array is not written out first.
        return shorten(
            repr(value[:20] if isinstance(value, str | list | tuple) and len(value) > 100 else value),
            LONGEST_PART,
        )
    except (RecursionError, ValueError):  # nested deeply; an integer of thousands of digits
        return f"a {type(value).__name__} that is too long to show"


def _sentences(model: type[BaseModel], fault: ValidationError) -> tuple[list[str], int]:
    """A sentence for each of the first faults, and the number of all.

    Unknown keys come first, since they are most often the cause of missing ones.
    """
    errors = fault.errors(include_url=False)
    unknown = [error for error in errors if error["type"] == "extra_forbidden"]
    meant = set[tuple[int | str, ...]]()
    sentences: list[str] = []
    for error in unknown[:MOST_FAULTS]:
        location, known, _ = _follow(model, error["loc"])
        word = str(location[-1])
        meant |= {(*location[:-1], near) for near in _nearest(word, known)}
        sentences.append(f"unknown key '{_dotted(location)}'{suggestion(word, known)}")
    # What an unknown key is to be called is not missing, and a list of wrong items not too short.
    parents = {error["loc"][:end] for error in errors for end in range(len(error["loc"]))}
    others = [
        error
        for error in errors
        if error["type"] != "extra_forbidden"
        and not (error["type"] == "too_short" and error["loc"] in parents)
        and not (error["type"] == "missing" and _follow(model, error["loc"])[0] in meant)
    ]
    sentences += [_sentence(model, error) for error in others[: MOST_FAULTS - len(sentences)]]
    return sentences, len(unknown) + len(others)


def _sentence(model: type[BaseModel], error: "ErrorDetails") -> str:
    """A sentence of an error other than an unknown key."""
    location, _, types = _follow(model, error["loc"])
    where = _dotted(location)
    if error["type"] == "missing":
        return f"'{where}' is missing"
    if error["type"] == "union_tag_invalid":
        given = error.get("ctx", {})["tag"]
        return f"'{where}.type': there is no {given!r}{suggestion(given, types)}"
    if error["type"] == "union_tag_not_found":
        return f"'{where}.type' is missing{suggestion('', types)}"
    if error["type"] == "value_error":
        text = f"'{where}': " if where else ""
        return text + str(error.get("ctx", {}).get("error"))
    message = error["msg"][0].lower() + error["msg"][1:]
    for theirs, ours in _IN_TOML.items():
        message = message.replace(theirs, ours)
    return f"'{where}': {message}, got {shown_value(error['input'])}"


def _dotted(location: Iterable[int | str]) -> str:
    """`objects[1].shape.radius_mm` from a location."""
    text = ""
    for part in location:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += f".{part}" if text else part
    return text


def suggestion(word: str, known: Iterable[str]) -> str:
    """'; did you mean ...?' for the nearest known word, else the list of what is known."""
    words = sorted(known)
    if len(word) > LONGEST_PART:
        return ""
    near = _nearest(word, words)
    if near:
        return f"; did you mean '{near[0]}'?"
    return f"; known are {', '.join(words)}" if words else ""


def _nearest(word: str, known: Iterable[str]) -> list[str]:
    """The known word that is most like this one, if any is."""
    if len(word) > LONGEST_PART:
        return []
    return difflib.get_close_matches(word, sorted(known), n=1, cutoff=0.6)


def _follow(
    model: type[BaseModel], location: tuple[int | str, ...]
) -> tuple[tuple[int | str, ...], set[str], set[str]]:
    """Pydantic's location without the tags of unions, the keys known at its last part, the types there."""
    candidates: list[type[BaseModel]] = [model]
    path: list[int | str] = []
    last: set[str] = set()
    tags: set[str] = set()
    for part in location:
        if part in tags:
            tagged = [one for one in candidates if part == _tag(one)]
            # Once the model is known what follows are its fields, even one that is named like a tag.
            candidates, tags = (tagged, set()) if tagged else (candidates, tags - {str(part)})
            continue
        path.append(part)
        if isinstance(part, str):
            last = {key for candidate in candidates for key in candidate.model_fields}
            fields = [one.model_fields[part] for one in candidates if part in one.model_fields]
            candidates = [inner for field in fields for inner in _models_in(field.annotation)]
            tags = {tag for field in fields for tag in _tags_in(field.annotation)}
            tags |= {tag for one in candidates if (tag := _tag(one)) is not None}
    return tuple(path), last, {tag for one in candidates if (tag := _tag(one)) is not None}


def _tag(model: type[BaseModel]) -> str | None:
    """The value of `type` by which a union recognises the model."""
    field = model.model_fields.get("type")
    return None if field is None else field.default


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models_in(part)]


def _tags_in(annotation: Any) -> list[str]:
    """Names that a union gives to its parts."""
    if isinstance(annotation, Tag):
        return [annotation.tag]
    return [tag for part in get_args(annotation) for tag in _tags_in(part)]

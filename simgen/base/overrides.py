"""Values given as `key=value`, as `--set` has them."""

import tomllib
from collections.abc import Sequence
from typing import Any

from pcii.base.errors import InputError


def override(values: dict[str, Any], overrides: Sequence[str]) -> None:
    """Put values given as `key=value` into what a recipe says; raises `InputError` for any other text."""
    for text in overrides:
        _override(values, text)


def _override(values: dict[str, Any], text: str) -> None:
    key, equals, value = text.partition("=")
    if not equals or not all(key.split(".")):
        raise InputError(f"--set: expected key=value such as photons.budget=300, got {text!r}")
    *tables, last = key.split(".")
    target = values
    for table in tables:
        target = target.setdefault(table, {})
        if not isinstance(target, dict):
            raise InputError(f"--set: {table!r} in {key!r} is a value, not a table")
    try:
        target[last] = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        if value.startswith(("[", "{")):
            raise InputError(
                f"--set: {text!r} is a list or table that cannot be read; words in it need quotation marks, "
                'as in \'scene=["two_objects", "overlap"]\''
            ) from None
        target[last] = value

"""Values of a TOML file that are drawn: the numbers, choices and variables of a scene that is a distribution.

Every drawn number has a random stream of its own, keyed by its place in the file and the number of the draw,
so that a change elsewhere in the file leaves it as it is. Only `random.Random(...).random()` is used, whose
sequence Python keeps for all time; NumPy's may change.
"""

import hashlib
import json
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import accumulate
from random import Random
from statistics import NormalDist
from typing import Any, NoReturn

from pcii.base.errors import InputError
from simgen.base.strict_models import shown_value, suggestion

LARGEST = 1e300
DIGITS = 6
"""Significant digits of a drawn number: with fewer than a machine has, all machines draw the same."""
MOST_VALUES = 1_000_000
"""A draw may hold so many values, however often its variables use one another."""
CUT = 4.0
"""Normal numbers lie within so many deviations."""
_CUT_SHARE = NormalDist().cdf(-CUT)


@dataclass(frozen=True)
class NumberKind:
    """A distribution of a number by two bounds."""

    expected: str
    """What bounds there can be, for whoever gives others."""
    allows: Callable[[Any, Any], bool]
    at: Callable[[Any, Any, float], int | float]
    """The value below which a share of all draws lies."""


def is_number(value: Any) -> bool:
    """Whether a TOML value is a number to compute with: no bool or NaN, and not beyond `LARGEST`."""
    return isinstance(value, int | float) and not isinstance(value, bool) and -LARGEST <= value <= LARGEST


def is_whole(value: Any) -> bool:
    """Whether a TOML value is a whole number."""
    return isinstance(value, int) and is_number(value)


def rounded(value: int | float) -> int | float:
    """A float with as many digits as drawn numbers have; whole numbers stay."""
    return value if isinstance(value, int) else float(f"{value:.{DIGITS}g}")


def _between(low: float, high: float, share: float) -> float:
    return low * (1 - share) + high * share


def _within(low: float, high: float, value: float) -> float:
    return float(min(max(rounded(value), low), high))


NUMBER_KINDS = {
    "uniform": NumberKind(
        "[low, high] with low <= high",
        lambda low, high: low <= high,
        lambda low, high, share: _within(low, high, _between(low, high, share)),
    ),
    "log_uniform": NumberKind(
        "[low, high] with 0 < low <= high",
        lambda low, high: 0 < low <= high,
        lambda low, high, share: _within(low, high, math.exp(_between(math.log(low), math.log(high), share))),
    ),
    "normal": NumberKind(
        "[mean, deviation] with deviation >= 0",
        lambda mean, deviation: deviation >= 0,
        lambda mean, deviation, share: rounded(
            mean + deviation * NormalDist().inv_cdf(_between(_CUT_SHARE, 1 - _CUT_SHARE, share))
        ),
    ),
    "integer": NumberKind(
        "[low, high], whole numbers with low <= high and less than 2^53 apart",
        lambda low, high: is_whole(low) and is_whole(high) and low <= high < low + (1 << 53),
        lambda low, high, share: min(low + math.floor(share * (high - low + 1)), high),
    ),
}
# Keys that may stand beside each.
KINDS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(NUMBER_KINDS, ()),
    "choice": ("weights",),
    "variable": ("times", "plus", "item"),
}


@dataclass(frozen=True)
class Place:
    """Where a value stands: as errors name it, and as its random stream is keyed."""

    shown: str
    key: tuple[str | int, ...]
    attempt: int = 0
    """Which try, of what is drawn again until it fits."""

    def __getitem__(self, part: str | int) -> "Place":
        shown = f"{self.shown}[{part}]" if isinstance(part, int) else f"{self.shown}.{part}"
        return replace(self, shown=shown, key=(*self.key, part))


class Drawing:
    """One draw of a file: its number, its variables so far, and how large it has become."""

    def __init__(self, number: int, source: str) -> None:
        self.number = number
        self.source = source
        self._variables: dict[str, tuple[Any, int]] = {}
        """Values, and how many values each of them holds."""
        self._later: set[str] = set()
        self._held = 0

    def refuse(self, place: Place, text: str) -> NoReturn:
        """Raise `InputError` about a value."""
        raise InputError(f"{self.source}: {place.shown}: {text}")

    def define(self, variables: Any) -> None:
        """Draw the table of variables, in order; each may use those before."""
        table = Place("variables", ("variables",))
        if not isinstance(variables, dict):
            self.refuse(table, f"expected a table, got {shown_value(variables)}")
        self._later = set(variables)
        for name, given in variables.items():
            before = self._held
            value = self.value(given, table[name])
            self._later.discard(name)
            self._variables[name] = value, self._held - before

    def value(self, given: Any, place: Place) -> Any:
        """A value of the file with everything in it drawn."""
        self._hold(1, place)
        if isinstance(given, list):
            return [self.value(item, place[position]) for position, item in enumerate(given)]
        if not isinstance(given, dict):
            return given
        kinds = [kind for kind in KINDS if kind in given]
        if not kinds:
            return {key: self.value(item, place[key]) for key, item in given.items()}
        kind = kinds[0]
        unknown = [key for key in given if key != kind and key not in KINDS[kind]]
        if unknown:
            self.refuse(
                place, f"unknown key '{unknown[0]}' beside '{kind}'{suggestion(unknown[0], KINDS[kind])}"
            )
        if kind == "choice":
            return self._choice(given, place)
        if kind == "variable":
            return self._variable(given, place)
        return self._number(kind, given[kind], place)

    def again(self, given: Any, place: Place, attempt: int) -> Any:
        """Another draw of a value that has been drawn, in its stead."""
        held = self._held
        value = self.value(given, replace(place, attempt=attempt))
        self._held = held
        return value

    def _hold(self, count: int, place: Place) -> None:
        self._held += count
        if self._held > MOST_VALUES:
            self.refuse(place, f"a draw of a scene may hold {MOST_VALUES} values, and this has more")

    def _share(self, place: Place) -> float:
        """A random number from 0 to 1, of this place alone."""
        key = json.dumps([place.key, self.number, place.attempt])
        return Random(int.from_bytes(hashlib.sha256(key.encode()).digest(), "big")).random()

    def _number(self, kind: str, bounds: Any, place: Place) -> Any:
        """A number; or a list, where both bounds are lists."""
        rule = NUMBER_KINDS[kind]
        if not _are_bounds(rule, bounds):
            self.refuse(place, f"{kind}: expected {rule.expected}, got {shown_value(bounds)}")
        low, high = bounds
        if not isinstance(low, list):
            return rule.at(low, high, self._share(place))
        self._hold(len(low), place)
        return [
            rule.at(least, most, self._share(place[position]))
            for position, (least, most) in enumerate(zip(low, high, strict=True))
        ]

    def _choice(self, given: dict[str, Any], place: Place) -> Any:
        entries = given["choice"]
        if not isinstance(entries, list) or not entries:
            self.refuse(place, f"choice: expected [x, y, ...], got {shown_value(entries)}")
        weights = given.get("weights", [1] * len(entries))
        if not (
            isinstance(weights, list)
            and len(weights) == len(entries)
            and all(is_number(weight) and weight >= 0 for weight in weights)
            and 0 < sum(weights) <= LARGEST
        ):
            text = f"weights: expected a number >= 0 for each of the {len(entries)} entries, not all 0"
            self.refuse(place, f"{text}, got {shown_value(weights)}")
        # All are drawn, so that a mistake in any of them is found by every draw.
        drawn = [self.value(entry, place["choice"][position]) for position, entry in enumerate(entries)]
        mark = self._share(place) * sum(weights)
        below = (position for position, until in enumerate(accumulate(weights)) if mark < until)
        last = max(position for position, weight in enumerate(weights) if weight > 0)
        return drawn[next(below, last)]

    def _variable(self, given: dict[str, Any], place: Place) -> Any:
        name = given["variable"]
        if not isinstance(name, str) or name not in self._variables:
            if isinstance(name, str) and name in self._later:
                self.refuse(place, f"the variable '{name}' is not drawn before this; put it further up")
            known = suggestion(name, self._variables) if isinstance(name, str) else ""
            self.refuse(place, f"there is no variable {shown_value(name)}{known}")
        value, held = self._variables[name]
        self._hold(held, place)
        options = {key: self.value(given[key], place[key]) for key in KINDS["variable"] if key in given}
        if "item" in options:
            item = options.pop("item")
            if not isinstance(value, list) or not is_whole(item) or not 0 <= item < len(value):
                self.refuse(place, f"item: there is no item {shown_value(item)} in {shown_value(value)}")
            value = value[item]
        if not options:
            return value
        return self._line(value, options.get("times", 1), options.get("plus", 0), place)

    def _line(self, value: Any, times: Any, plus: Any, place: Place) -> Any:
        """value * times + plus, of numbers or of lists of as many."""
        parts = (value, times, plus)
        lengths = {len(part) for part in parts if isinstance(part, list)}
        if len(lengths) > 1:
            self.refuse(place, f"times and plus must be numbers, or lists as long as {shown_value(value)}")
        rows = [part if isinstance(part, list) else [part] * max(lengths, default=1) for part in parts]
        if not all(is_number(part) for row in rows for part in row):
            wrong = next(part for row in rows for part in row if not is_number(part))
            self.refuse(place, f"times and plus are of numbers, and {shown_value(wrong)} is none")
        products = [one * factor for one, factor in zip(rows[0], rows[1], strict=True)]
        if not all(is_number(product) for product in products):
            self.refuse(place, "times: the result is too large")
        result = [rounded(product + term) for product, term in zip(products, rows[2], strict=True)]
        self._hold(len(result), place)
        return result if lengths else result[0]


def _are_bounds(rule: NumberKind, bounds: Any) -> bool:
    """Whether these are two numbers that suit the distribution, or two lists of as many such numbers."""
    if not isinstance(bounds, list) or len(bounds) != 2:
        return False
    low, high = bounds
    if isinstance(low, list) and isinstance(high, list) and len(low) == len(high) > 0:
        pairs = list(zip(low, high, strict=True))
    else:
        pairs = [(low, high)]
    return all(is_number(least) and is_number(most) and rule.allows(least, most) for least, most in pairs)


def holds_draws(values: Any) -> bool:
    """Whether there is anything in a TOML value that is drawn."""
    if isinstance(values, dict):
        return bool(KINDS.keys() & values) or _any_holds(values.values())
    return isinstance(values, list) and _any_holds(values)


def _any_holds(values: Iterable[Any]) -> bool:
    return any(holds_draws(value) for value in values)

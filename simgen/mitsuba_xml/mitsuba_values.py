"""Values in Mitsuba scene files: numbers, vectors, colours, spectra and transforms.

Mitsuba 3, "Scene XML file format". What these functions say in a `ValueError` is the end of a sentence.
"""

import math
import re
from itertools import pairwise

import numpy as np

from simgen.base.strict_models import shown_value
from simgen.mitsuba_xml.mitsuba_files import Element
from simgen.mitsuba_xml.mitsuba_scene import Rgb, SpectrumValues, Value, Vector

MOST_SAMPLES = 2000
LONGER_AXIS = 0.01
"""By so much the length of an axis may be off, as numbers of two digits are."""
_AXES = ("x", "y", "z")
_NUMBER = re.compile(r" *[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)? *")
_WHOLE = re.compile(r" *-?[0-9]{1,18} *")
_ATTRIBUTES: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("float", "integer", "boolean", "string", "rgb", "spectrum"), ("name", "value")),
    **dict.fromkeys(("vector", "point"), ("name", "value?", "x?", "y?", "z?")),
    **dict.fromkeys(("translate", "scale"), ("value?", "x?", "y?", "z?")),
    "rotate": ("angle", "value?", "x?", "y?", "z?"),
    "lookat": ("origin", "target", "up?"),
    "matrix": ("value",),
    "transform": ("name",),
    "default": ("name", "value"),
    "ref": ("id", "name?"),
    "alias": ("id", "as"),
    "include": ("filename", "name?"),
}
"""What an element may say, by its tag; a question mark stands after what it need not say."""


def check_attributes(element: Element, expected: tuple[str, ...] | None = None) -> None:
    """`ValueError` unless an element has the attributes that its tag needs, and no others."""
    allowed = _ATTRIBUTES[element.tag] if expected is None else expected
    for name in element.attributes:
        if name not in allowed and f"{name}?" not in allowed:
            raise ValueError(f"<{element.tag}> has no attribute {shown_value(name)}")
    for name in allowed:
        # A name must not be empty; other attributes are looked at where their values are.
        if not name.endswith("?") and not (
            name in element.attributes and (element.attributes[name] or name != "name")
        ):
            raise ValueError(f"<{element.tag}> needs the attribute '{name}'")


def value_of(element: Element) -> Value:
    """The value of a parameter, of any tag but a spectrum's that is in a file."""
    check_attributes(element)
    given = element.attributes
    match element.tag:
        case "float":
            return number(given["value"])
        case "integer":
            if not _WHOLE.fullmatch(given["value"]):
                raise ValueError(f"a whole number is needed, not {shown_value(given['value'])}")
            return int(given["value"])
        case "boolean":
            if given["value"].lower() not in ("true", "false"):
                raise ValueError(f"true or false is needed, not {shown_value(given['value'])}")
            return given["value"].lower() == "true"
        case "string":
            return given["value"]
        case "vector" | "point":
            return _vector(element, None)
        case "rgb":
            if given["value"].startswith("#"):
                raise ValueError(
                    "Mitsuba 3 takes no hexadecimal colours; write red, green and blue as numbers"
                )
            return Rgb(_one_or_three(given["value"]))
        case "spectrum":
            return _spectrum(given["value"])
        case _:
            return _transform(element)


def number(text: str) -> float:
    """A finite number."""
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(value):
        raise ValueError(f"a finite number is needed, not {shown_value(text)}")
    return value


def spectrum_of_file(data: bytes) -> SpectrumValues:
    """The spectrum in a text file: a wavelength in nm and a value in each line, `#` before comments."""
    lines = [line.strip() for line in data.decode("latin-1").splitlines()]
    rows = [line.replace(",", " ").split() for line in lines if line and not line.startswith("#")]
    if any(len(row) != 2 for row in rows):
        raise ValueError("each line needs a wavelength and a value")
    return _sampled(rows)


def _spectrum(text: str) -> SpectrumValues:
    """One number, or wavelengths in nm with values as in "400:0.1, 500:0.2"."""
    words = _words(text)
    if len(words) == 1 and ":" not in words[0]:
        return SpectrumValues((), (number(words[0]),))
    pairs = [word.split(":") for word in words]
    if any(len(pair) != 2 for pair in pairs):
        raise ValueError(f"a number or pairs such as 400:0.1, 500:0.2 are needed, not {shown_value(text)}")
    return _sampled(pairs)


def _sampled(pairs: list[list[str]]) -> SpectrumValues:
    if not 2 <= len(pairs) <= MOST_SAMPLES:
        raise ValueError(f"a spectrum has 2 to {MOST_SAMPLES} wavelengths, not {len(pairs)}")
    wavelengths = tuple(number(pair[0]) for pair in pairs)
    if any(here >= there for here, there in pairwise(wavelengths)):
        raise ValueError("the wavelengths of a spectrum must grow")
    return SpectrumValues(wavelengths, tuple(number(pair[1]) for pair in pairs))


def _words(text: str) -> list[str]:
    """What spaces and commas part."""
    return text.replace(",", " ").split()


def _three(text: str) -> Vector:
    words = _words(text)
    if len(words) != 3:
        raise ValueError(f"three numbers are needed, not {shown_value(text)}")
    return number(words[0]), number(words[1]), number(words[2])


def _one_or_three(text: str) -> Vector:
    words = _words(text)
    if len(words) != 1:
        return _three(text)
    value = number(words[0])
    return value, value, value


def _vector(element: Element, missing: float | None) -> Vector:
    """From `value`, or from `x`, `y` and `z`, of which some may be missing if a number stands in for them."""
    given = element.attributes
    named = [axis for axis in _AXES if axis in given]
    if "value" in given:
        if named:
            raise ValueError(f"<{element.tag}> takes either 'value' or 'x', 'y' and 'z'")
        return _one_or_three(given["value"])
    if missing is None:
        if len(named) < 3:
            raise ValueError(f"<{element.tag}> needs 'value', or 'x', 'y' and 'z'")
        missing = 0.0
    x, y, z = (number(given[axis]) if axis in given else missing for axis in _AXES)
    return x, y, z


def _transform(element: Element) -> np.ndarray:
    """(4, 4): the first step is done first, so each new one is multiplied from the left."""
    total = np.eye(4)
    with np.errstate(all="ignore"):  # what overflows is refused below
        for step in element.children:
            if step.tag not in STEPS:
                raise ValueError(f"<transform> takes {', '.join(STEPS)}, not <{step.tag}>")
            if step.children:
                raise ValueError(f"<{step.tag}> holds no other elements")
            check_attributes(step)
            total = STEPS[step.tag](step) @ total
    if not np.isfinite(total).all():
        raise ValueError("the numbers of this transform are too large")
    total.flags.writeable = False
    return total


def _translate(step: Element) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = _vector(step, 0.0)
    return matrix


def _scale(step: Element) -> np.ndarray:
    return np.diag([*_vector(step, 1.0), 1.0])


def _rotate(step: Element) -> np.ndarray:
    """By an angle in degrees, counter-clockwise about an axis that points at the observer (Rodrigues)."""
    given = np.array(_vector(step, 0.0))
    axis = _unit(given, "the axis of a rotation must not be 0")
    # A longer one makes Mitsuba 3 shear what it turns, but not older versions: which is meant cannot be told.
    if abs(float(axis @ given) - 1) > LONGER_AXIS:
        x, y, z = (f"{one:.6g}" for one in axis)
        raise ValueError(f'the axis of a rotation must have length 1; write x="{x}" y="{y}" z="{z}"')
    angle = math.radians(number(step.attributes["angle"]))
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = np.eye(4)
    matrix[:3, :3] += math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return matrix


def _look_at(step: Element) -> np.ndarray:
    """Rigid motion (4, 4) to `origin` that turns +Z towards `target`, and +Y as far as possible to `up`."""
    origin, target = (np.array(_three(step.attributes[key])) for key in ("origin", "target"))
    ahead = _unit(target - origin, "'target' must not be at 'origin'")
    up = np.array(_three(step.attributes.get("up") or "0 0 0"))
    if not up.any():
        up = any_across(*ahead)
    left = _unit(np.cross(up, ahead), "'up' must not be along the line from 'origin' to 'target'")
    matrix = np.eye(4)
    matrix[:3] = np.stack([left, np.cross(ahead, left), ahead, origin], axis=-1)
    return matrix


def any_across(x: float, y: float, z: float) -> np.ndarray:
    """A unit vector at right angles to one.

    Duff et al., "Building an orthonormal basis, revisited" (2017), as in Mitsuba.
    """
    sign = math.copysign(1.0, z)
    a = -1 / (sign + z)
    return np.array([1 + sign * x * x * a, sign * x * y * a, -sign * x])


def _matrix(step: Element) -> np.ndarray:
    """9 or 16 numbers, row by row."""
    words = _words(step.attributes["value"])
    if len(words) not in (9, 16):
        raise ValueError(f"a matrix has 9 or 16 numbers, not {len(words)}")
    side = 3 if len(words) == 9 else 4
    matrix = np.eye(4)
    matrix[:side, :side] = np.reshape([number(word) for word in words], (side, side))
    if (matrix[3] != (0, 0, 0, 1)).any():
        raise ValueError("the last row of a matrix must be 0 0 0 1")
    return matrix


def _unit(vector: np.ndarray, otherwise: str) -> np.ndarray:
    length = float(np.linalg.norm(vector))
    if not length or not math.isfinite(length):
        raise ValueError(otherwise)
    return vector / length


STEPS = {
    "translate": _translate,
    "scale": _scale,
    "rotate": _rotate,
    "lookat": _look_at,
    "matrix": _matrix,
}

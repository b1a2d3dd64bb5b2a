"""What all types share: checks of arrays, and how a value is drawn.

Axes, always in this order: (K, L, H, W, C) for views, (Z, H, W, C) for sections; C is R, G, B.
Lengths are millimetres and carry `_mm`; `z` is planar depth from the camera plane, never ray length.
"""

from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np

from pcii.base import InputError, ShortForm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

LARGEST_COUNT = 1 << 40
"""Most photons of a pixel; the sum over millions of such pixels fits in 64 bits."""
MOST_DEPTHS = 10_000
"""Longest list of depths, typed or stored; a longer one is taken for an error."""


class Plottable(ShortForm):
    """A type of which `pcii.figures.plots` draws values: `plot` in axes, and a picture in notebooks."""

    def plot(self, axes: "Axes | Sequence[Axes] | np.ndarray | None" = None, **options: Any) -> np.ndarray:
        """Draw into Matplotlib `axes`, one for each panel, and return them as an array (N,).

        They are by default those of a new figure. What is drawn, and with what options:

        | of | picture | options |
        |---|---|---|
        | `PhotonCounts` | the photons of a camera | `view`: (k, l) |
        | `Views` | one elemental image | `view`: (k, l) |
        | `Sections`, `Segmented` | a panel a section, with outlines of the masks; 12 at most | |
        | `DepthMap` | depth, grey without an answer | `z_range_mm`: (near, far) of the scale |
        | `Truth` | depth, and the objects | `z_range_mm` |

        All sections have the same exposure: the 98th percentile of what is lit is white. For print,
        `style="paper"` has a white background and a scale bar in place of axes, in mm at the depth of a
        section: `sections.plot(style="paper")[0].figure.savefig("sections.pdf")`, or .svg.

        Raises `InputError` for what are no axes, another number of them, and no camera of the grid.
        """
        from pcii.figures import draw

        return draw(self, axes, **options)

    def _repr_html_(self) -> str:
        from pcii.figures import picture_html

        return picture_html(self)


def is_whole(value: object) -> TypeGuard[int]:
    """Whether a value is a whole number, of Python or of NumPy."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def read_only(array: np.ndarray) -> np.ndarray:
    """A view of `array` that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


def freeze_array(owner: object, name: str, dtype: str, shape: tuple[int | str, ...]) -> None:
    """Make an array of a frozen dataclass one that cannot be written to; `InputError` if it is no such array.

    The dtype "real numbers" stands for all real numbers, and a word in place of a size for any size.
    """
    values = getattr(owner, name)
    fits = (
        isinstance(values, np.ndarray)
        and (values.dtype.kind in "fiu" if dtype == "real numbers" else values.dtype == dtype)
        and values.ndim == len(shape)
        and all(isinstance(size, str) or size == n for size, n in zip(shape, values.shape, strict=True))
    )
    if not fits:
        is_array = isinstance(values, np.ndarray)
        got = f"{values.dtype} {values.shape}" if is_array else type(values).__name__
        raise InputError(f"{name}: expected {dtype} ({', '.join(map(str, shape))}), got {got}")
    object.__setattr__(owner, name, read_only(values))


def check_z_mm(z_mm: object) -> np.ndarray:
    """Depths in mm as a float64 array (Z,), from one number or a list.

    Raises `InputError` for no depth, or one that is not a finite number above 0.

    >>> check_z_mm(540).tolist()
    [540.0]
    """
    try:
        z = np.atleast_1d(np.asarray(z_mm, dtype=np.float64))
    except (TypeError, ValueError):
        raise InputError(f"z_mm: expected depths in millimetres, got {z_mm!r}") from None
    if z.ndim != 1 or z.size == 0:
        raise InputError("z_mm: expected one depth or a list of depths in millimetres")
    is_depth = np.isfinite(z) & (z > 0)
    if not is_depth.all():
        raise InputError(f"z_mm: a depth must be a finite number above 0 mm, got {z[~is_depth][0]:g}")
    return z


def check_depth_range(z_range_mm: object) -> tuple[float, float]:
    """The nearest and farthest depth in mm of a range; raises `InputError` for anything else."""
    depths = check_z_mm(z_range_mm).tolist()
    if len(depths) != 2:
        raise InputError(f"z_range_mm: expected two depths in mm, (near, far), got {z_range_mm!r}")
    near, far = depths
    if near >= far:
        raise InputError(f"z_range_mm: near must be less than far, got {near:g} and {far:g}")
    return near, far


def whole_counts(name: str, values: np.ndarray) -> np.ndarray:
    """Counts as integers: integers >= 0 as they are, floats if whole; else raises `InputError`.

    The largest count is 2^40, and the sum of all is below 2^63, which 64 bits hold.
    """
    array = np.asarray(values)
    kind = array.dtype.kind
    if kind not in "iubf" or (kind == "f" and not (np.isfinite(array) & (array == np.floor(array))).all()):
        raise InputError(f"{name}: photon counts must be whole numbers, got {array.dtype}")
    if array.size and array.min() < 0:
        raise InputError(f"{name}: photon counts must not be negative")
    if array.size and float(array.max()) > LARGEST_COUNT:
        raise InputError(f"{name}: more than 2^40 photons in a pixel cannot be summed exactly")
    if array.size * LARGEST_COUNT >= 1 << 63 and array.sum(dtype=np.float64) >= 2.0**63:
        raise InputError(f"{name}: 2^63 photons in all, or more, cannot be summed exactly")
    integers = {"f": np.dtype(np.int64), "b": np.dtype(np.uint8)}
    return array.astype(integers.get(kind, array.dtype.newbyteorder("=")), copy=False)

"""Objects in colours, with their names beside the picture."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pcii.figures.palette import COLOURS, plot_label
from pcii.figures.panels import hide_frame, show_picture, write_in_middle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_NAMES = 40
"""Objects that are named in a picture: the largest."""
MARGIN = 0.42
"""Room for names on either side of a picture, as a share of its longer side."""
SHADES = (1.0, 0.7, 0.5)
"""Brightness of the colours, where all but black are used up."""
LINES = 20
"""So many names fit beside the height of a picture."""


def named_width(aspect: float) -> float:
    """How many times as wide as a picture it is together with names, for its width over its height."""
    return 1 + 2 * MARGIN * max(1.0, 1 / aspect)


def draw_objects(axes: "Axes", object_id: np.ndarray, names: Mapping[int, str]) -> None:
    """Objects (H, W) in colours, black where none is; their names beside them, each with a line to it.

    Names stand in two columns in the order of the objects' rows, evenly apart where they would touch, so that
    two dozen can be read.
    """
    from matplotlib.patheffects import withStroke

    height, width = object_id.shape
    image = np.zeros((height, width, 3))
    ids, sizes = np.unique(object_id[object_id > 0], return_counts=True)
    for place, number in enumerate(ids.tolist()):
        image[object_id == number] = _colour(place)
    show_picture(axes, image, object_id.shape, "objects")
    hide_frame(axes)
    if not ids.size:
        write_in_middle(axes, "no object is seen")
        return
    anchors = {
        number: _inside(object_id == number)
        for number in ids[np.argsort(-sizes, kind="stable")][:MOST_NAMES].tolist()
    }
    room = MARGIN * max(height, width)
    seen = {"color": "0.2", "path_effects": [withStroke(linewidth=2, foreground="white")]}  # on all colours
    by_column = sorted(anchors, key=lambda number: anchors[number][1])
    half = len(by_column) // 2
    for group, edge, side in ((by_column[:half], -0.5, -1), (by_column[half:], width - 0.5, 1)):
        group = sorted(group, key=lambda number: anchors[number][0])
        rows = spread_out(np.array([anchors[number][0] for number in group], dtype=float), height)
        for number, row in zip(group, rows, strict=True):
            i, j = anchors[number]
            end = edge + side * 0.1 * room
            axes.plot([j, edge, end], [i, row, row], linewidth=0.7, clip_on=False, **seen)
            axes.plot([j], [i], marker="o", markersize=2.5, **seen)
            align = "left" if side > 0 else "right"
            text = plot_label(names[number])
            axes.text(end + side * 0.02 * room, row, text, ha=align, va="center", fontsize="small")
    axes.set_xlim(-0.5 - room, width - 0.5 + room)


def spread_out(places: np.ndarray, length: float) -> np.ndarray:
    """Sorted places (N,) moved as little as it takes to be length / max(LINES, N) apart, in 0 .. length."""
    gap = length / max(LINES, places.size)
    steps = gap * np.arange(places.size)
    # Less their steps, places must not fall: pooling neighbours that do is isotonic regression.
    pools: list[list[float]] = []
    for place in np.clip(places, gap / 2, length - gap / 2) - steps:
        pools.append([float(place)])
        while len(pools) > 1 and np.mean(pools[-2]) > np.mean(pools[-1]):
            pools[-2:] = [pools[-2] + pools[-1]]
    level = np.array([np.mean(pool) for pool in pools for _ in pool])
    return np.clip(level, gap / 2, length - gap / 2 - steps[-1] if places.size else 0) + steps


def _colour(place: int) -> np.ndarray:
    """The colour of the object in this place; black is where no object is."""
    from matplotlib.colors import to_rgb

    turn, number = divmod(place, len(COLOURS) - 1)
    return np.array(to_rgb(COLOURS[number])) * SHADES[turn % len(SHADES)]


def _inside(mask: np.ndarray) -> tuple[int, int]:
    """The pixel of a mask that is farthest from its border: a place for a line to end."""
    from scipy.ndimage import distance_transform_edt

    depth = np.asarray(distance_transform_edt(np.pad(mask, 1)))[1:-1, 1:-1]
    i, j = np.unravel_index(int(depth.argmax()), mask.shape)
    return int(i), int(j)

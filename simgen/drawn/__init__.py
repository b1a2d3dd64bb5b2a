"""Scenes that Python draws by number, of eight kinds; for methods to be judged on what nobody arranged.

A scene is the same for all time. Depths, sizes, shapes, colours, textures and lights differ.

clutter      Kinds of drawn scenes that are full: heaps of cards, rooms, leaves.
composition  What drawn scenes are composed of: depths, objects that stand there, lamps.
few_solids   Kinds of drawn scenes with two or three solids before a dark backdrop.
surfaces     Materials of drawn scenes: plain, patterned, glossy.
"""

from collections.abc import Callable
from typing import Any

from simgen.drawn.clutter import drawn_cards, drawn_leaves, drawn_room
from simgen.drawn.few_solids import (
    drawn_checks,
    drawn_crossing,
    drawn_plain,
    drawn_shiny,
    drawn_textured,
)

GENERATORS: dict[str, Callable[[int], dict[str, Any]]] = {
    function.__name__: function
    for function in (
        drawn_plain,
        drawn_textured,
        drawn_cards,
        drawn_room,
        drawn_crossing,
        drawn_leaves,
        drawn_checks,
        drawn_shiny,
    )
}
"""The functions by the names of their scenes; each gives the values of the scene of a number."""

"""Shapes that objects of a scene can have, in millimetres about the object's position."""

from typing import Annotated, Literal

from pydantic import Field

from simgen.schema import Positive, Strict


class Sphere(Strict):
    """A sphere about the object's position."""

    type: Literal["sphere"] = "sphere"
    radius_mm: Positive


class Card(Strict):
    """A flat rectangle about the object's position; unrotated it faces the cameras."""

    type: Literal["card"] = "card"
    width_mm: Positive
    height_mm: Positive


class Mesh(Strict):
    """A PLY mesh in the scene's folder, in millimetres about the object's position."""

    type: Literal["mesh"] = "mesh"
    file: str
    """File name, inside the scene's folder."""
    scale: Positive = 1.0


Shape = Annotated[Sphere | Card | Mesh, Field(discriminator="type")]

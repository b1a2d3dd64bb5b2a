"""Shapes that objects of a scene can have, in millimetres about the object's position."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag

from simgen.base import Length, MeshName, Real, Strict


class Sphere(Strict):
    """A sphere about the object's position; a picture goes around it like a map around a globe.

    Its middle faces the cameras, its upper border is the pole above, its sides meet behind.
    """

    type: Literal["sphere"] = "sphere"
    radius_mm: Length


class Card(Strict):
    """A flat rectangle about the object's position; unrotated it faces the cameras, picture upright."""

    type: Literal["card"] = "card"
    width_mm: Length
    height_mm: Length


class Box(Strict):
    """A box about the object's position; each of its six sides bears the whole picture.

    Unrotated its front faces the cameras. From there the front is upright, and so are the other sides
    for whoever walks around; the top is laid with its lower border in front, the bottom with its upper.
    """

    type: Literal["box"] = "box"
    width_mm: Length
    height_mm: Length
    depth_mm: Length


class Cylinder(Strict):
    """An upright cylinder with closed ends about the object's position, its axis along Y.

    A picture goes once around, upright, its middle in front and its sides meeting behind. Each end
    bears the picture's largest circle, laid as on the top and bottom of a box.
    """

    type: Literal["cylinder"] = "cylinder"
    radius_mm: Length
    length_mm: Length


def _has_extent(scales: tuple[float, float, float]) -> tuple[float, float, float]:
    if not all(scales):
        raise ValueError("a scale is not 0")
    return scales


LARGEST_SCALE = 1e15
Factor = Annotated[Real, Field(ge=-LARGEST_SCALE, le=LARGEST_SCALE)]
Scale = Annotated[
    Annotated[Factor, Field(gt=0), Tag("number")]
    | Annotated[tuple[Factor, Factor, Factor], AfterValidator(_has_extent), Tag("three")],
    Discriminator(lambda scale: "number" if isinstance(scale, int | float) else "three"),
]
"""One number, or three along the axes, of which negative ones mirror."""


class Mesh(Strict):
    """A PLY or OBJ mesh in the scene's folder; its axes are the world's, about the object's position.

    Its own texture coordinates (in PLY named s, t or u, v) begin at the picture's lower left. Without normals
    its faces are flat.
    """

    type: Literal["mesh"] = "mesh"
    file: Annotated[str, MeshName]
    """Name of a .ply or .obj file inside the scene's folder."""
    scale: Scale = 1.0
    """Millimetres for one unit of the file; or three numbers along the mesh's own axes, negative ones of
    which mirror it."""


Shape = Annotated[Sphere | Card | Box | Cylinder | Mesh, Field(discriminator="type")]

"""What a material needs of the mesh that it is on: pictures that are repeated, shine, or leave holes."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from simgen.assets.cutouts import cut_out
from simgen.assets.mesh_points import bears_pictures_once
from simgen.assets.triangles import Triangles
from simgen.importing.foreign_scene import ForeignScene

BORDER = 1e-4
"""Texture coordinates may pass the borders of a picture by so much."""


def fitted(
    made: Mapping[str, Any], triangles: Triangles, scene: ForeignScene, *, pictures_repeat: bool
) -> dict[str, Any] | None:
    """The material on this mesh: repeated where pictures are passed, shining where each part of them is
    there once, with holes that leave something of it; None if they leave nothing.

    What is lost by it is said in the scene, which also has the pictures.
    """
    material = dict(made)
    uv = triangles.texcoords
    if uv is not None and pictures_repeat and (uv.min() < -BORDER or uv.max() > 1 + BORDER):
        material["tiled"] = True
    if "texture" in material.get("emission", {}) and not bears_pictures_once(triangles):
        del material["emission"]
        scene.lose("pictures that shine, where parts of them are several times on a mesh")
    if "opacity" in material:
        stored = scene.images[material["opacity"]]
        try:
            if cut_out(triangles, stored / np.iinfo(stored.dtype).max, tiled="tiled" in material) is None:
                scene.lose("surfaces that are all clear")
                return None
        except ValueError:
            del material["opacity"]
            scene.lose("holes by pictures that are too fine for their mesh: it is whole")
    return material

"""What scenes made as glTF files have in common: turned bodies, boxes, pictures, and their import."""

import io
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from gltf_draft import QUAD, QUAD_FACES, QUAD_UV, GltfDraft
from PIL import Image

import simgen
from simgen.base import toml_text

SECTORS = 32
Lathe = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Positions (N, 3), corners of the faces (3 F,), uv (N, 2) and normals (N, 3)."""


def lathe(profile: list[tuple[float, float]]) -> Lathe:
    """A profile of (radius, height), outer side first, turned about Y: positions, faces, uv, normals."""
    points = np.array(profile)
    along = np.gradient(points, axis=0)
    outwards = np.stack([along[:, 1], -along[:, 0]], axis=-1)
    outwards /= np.linalg.norm(outwards, axis=-1, keepdims=True)
    angle = np.linspace(0, 2 * np.pi, SECTORS + 1)
    ring = np.stack([np.sin(angle), np.cos(angle)], axis=-1)

    def turned(radial: np.ndarray, height: np.ndarray) -> np.ndarray:
        x, z = radial[:, None] * ring[:, 0], radial[:, None] * ring[:, 1]
        return np.stack([x, np.broadcast_to(height[:, None], x.shape), z], axis=-1).reshape(-1, 3)

    v = np.linspace(1, 0, len(points))
    uv = np.stack(np.meshgrid(np.linspace(0, 1, SECTORS + 1), v), axis=-1).reshape(-1, 2)
    corner = np.arange(uv.shape[0]).reshape(len(points), SECTORS + 1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return (
        turned(points[:, 0], points[:, 1]).astype("<f4"),
        faces.ravel().astype("<u2"),
        uv.astype("<f4"),
        turned(outwards[:, 0], outwards[:, 1]).astype("<f4"),
    )


def box(x: float, y: float, z: float) -> Lathe:
    """A box about its middle, each side with the whole picture."""
    parts = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            normal = np.roll([sign, 0.0, 0.0], axis)
            right = np.roll([0.0, 1.0, 0.0], axis)
            up = np.cross(normal, right)
            corners = normal + QUAD[:, :1] * right + QUAD[:, 1:2] * up
            parts.append((corners * np.array([x, y, z]) / 2, np.repeat(normal[None], 4, axis=0)))
    positions, normals = (np.concatenate(kind).astype("<f4") for kind in zip(*parts, strict=True))
    faces = (4 * np.arange(6)[:, None] + QUAD_FACES).ravel().astype("<u2")
    return positions, faces, np.tile(QUAD_UV, (6, 1)), normals


def picture(draft: GltfDraft, pixels: np.ndarray, **sampler: int) -> int:
    """Pixels as a texture of the file."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "png", optimize=True)
    return draft.texture(file.getvalue(), **sampler)


def surface(name: str, roughness: float, **more: Any) -> dict[str, Any]:
    """A material that is no metal unless it says so."""
    numbers = {"metallicFactor": 0.0, "roughnessFactor": roughness, **more.pop("pbr", {})}
    return {"name": name, "pbrMetallicRoughness": numbers, **more}


def turn(x_deg: float = 0.0, y_deg: float = 0.0, z_deg: float = 0.0) -> list[float]:
    """The quaternion of turns about Z, then X, then Y."""
    result = np.array([0.0, 0.0, 0.0, 1.0])
    for axis, degrees in ((1, y_deg), (0, x_deg), (2, z_deg)):
        half = np.radians(degrees) / 2
        other = np.zeros(4)
        other[axis], other[3] = np.sin(half), np.cos(half)
        xyz = result[3] * other[:3] + other[3] * result[:3] + np.cross(result[:3], other[:3])
        result = np.array([*xyz, result[3] * other[3] - result[:3] @ other[:3]])
    return result.tolist()


def write_scene(file: Path, draft: GltfDraft, **fields: Any) -> None:
    """Write the .glb file, and beside it the scene that it is imported as, with these fields."""
    folder = file.parent
    file.write_bytes(draft.glb())
    with tempfile.TemporaryDirectory() as near:
        imported = simgen.import_scene(file, Path(near) / "scene")
        for made in imported.folder.iterdir():
            shutil.copyfile(made, folder / made.name)
    scene = simgen.load_scene(folder).change(**fields)
    comments = [f"Written by build_assets.py, which imports {file.name}; lengths in mm."]
    (folder / "scene.toml").write_text(toml_text(scene, comments), encoding="utf-8")

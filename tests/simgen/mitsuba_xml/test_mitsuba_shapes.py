"""Tables and shapes that are Mitsuba's, against Mitsuba itself."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simgen.assets.ply_files import ply_bytes
from simgen.assets.triangles import Triangles
from simgen.mitsuba_xml.mitsuba_substances import METALS
from simgen.mitsuba_xml.mitsuba_triangles import cube, cylinder, disk, laid_out, rectangle, smoothed, sphere
from simgen.renderer import backend

pytestmark = pytest.mark.renders
RNG = np.random.default_rng(3)


@pytest.mark.parametrize("name", METALS)
def test_metals_reflect_what_mitsuba_has_them_reflect(name: str) -> None:
    mi = backend.load()
    metal = mi.load_dict({"type": "conductor", "material": name})
    at = mi.SurfaceInteraction3f()
    at.wi = mi.Vector3f(0, 0, 1)
    _, share = metal.sample(mi.BSDFContext(), at, 0.5, mi.Point2f(0.5, 0.5))
    np.testing.assert_allclose(np.ravel(share), METALS[name], atol=6e-5)


def rays(inwards: bool) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions (N, 3) from around to the middle of a shape, or out of it."""
    away = RNG.normal(size=(200, 3))
    away *= 4 / np.linalg.norm(away, axis=1, keepdims=True)
    through = RNG.uniform((-0.4, -0.4, 0.1), (0.4, 0.4, 0.9), (200, 3))
    return (away + through, -away) if inwards else (through, away)


def hits(mi: Any, shape: Any, origin: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Texture coordinates, places and normals (N, 8) of the first hits, NaN for none."""
    scene = mi.load_dict({"type": "scene", "shape": shape})

    def found(start: Any, direction: Any) -> np.ndarray:
        hit = scene.ray_intersect(mi.Ray3f(mi.Point3f(start), mi.Vector3f(direction)))
        values = np.concatenate([np.array(one) for one in (hit.uv, hit.p, hit.sh_frame.n)])
        return np.where(hit.is_valid(), values, np.nan)

    if backend.is_scalar(mi):
        return np.array([found(*ray) for ray in zip(origin.tolist(), along.tolist(), strict=True)])
    return found(origin.T, along.T).T


@pytest.mark.parametrize("make", [rectangle, cube, sphere, disk, cylinder])
@pytest.mark.parametrize("inwards", [True, False])
def test_shapes_lie_where_mitsubas_do(tmp_path: Path, make: Callable[[], Triangles], inwards: bool) -> None:
    mi, origin_along = backend.load(), rays(inwards)
    mesh = make()
    assert mesh.texcoords is not None
    (tmp_path / "mesh.ply").write_bytes(ply_bytes(mesh))
    ours = {"type": "ply", "filename": str(tmp_path / "mesh.ply"), "flip_tex_coords": True}
    flat = {"face_normals": True} if mesh.normals is None else {}
    found, expected = (hits(mi, one, *origin_along) for one in (ours | flat, {"type": make.__name__}))
    both = np.isfinite(found).all(axis=1) & np.isfinite(expected).all(axis=1)
    assert both.sum() > 15
    # But for rays beside the edges.
    assert (np.isfinite(found) == np.isfinite(expected)).all(axis=1).mean() > 0.98
    # The sagitta of chords of 2 degrees is 1.5e-4 of the radius; at a slant it is some times that.
    np.testing.assert_allclose(found[both], expected[both], atol=3e-3)


def test_normals_of_meshes_without_any_are_mitsubas(tmp_path: Path) -> None:
    mi = backend.load()
    points = RNG.normal(size=(20, 3)).astype(np.float32)
    faces = np.array([RNG.choice(20, 3, replace=False) for _ in range(40)], np.int32)
    mesh = Triangles.checked(points, faces, None, None)
    (tmp_path / "mesh.ply").write_bytes(ply_bytes(mesh))
    theirs = mi.traverse(mi.load_dict({"type": "ply", "filename": str(tmp_path / "mesh.ply")}))
    normals = smoothed(mesh).normals
    assert normals is not None
    expected = np.array(theirs["vertex_normals"]).reshape(-1, 3)
    np.testing.assert_allclose(normals, expected, atol=2e-4)  # theirs takes a fast arc cosine


def test_a_mesh_without_texture_coordinates_gets_mitsubas() -> None:
    positions = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 1)], np.float32)
    mesh = Triangles(positions, np.array([(0, 1, 2), (1, 3, 2)], np.int32))
    laid = laid_out(mesh, np.eye(3))
    np.testing.assert_array_equal(laid.positions, positions[[0, 1, 2, 1, 3, 2]])
    # Up from below, while Mitsuba's run down from above.
    np.testing.assert_array_equal(laid.texcoords, 2 * [(0, 1), (1, 1), (0, 0)])

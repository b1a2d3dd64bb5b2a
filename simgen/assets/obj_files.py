"""Wavefront OBJ meshes: polygons with normals and texture coordinates; no other file is ever opened.

Appendix B1 of the Advanced Visualizer manual (Wavefront, 1993).
"""

import numpy as np

from simgen.assets.triangles import Triangles, check_counts, fan_all

# Materials and groups are the scene's business, points and lines have no surface.
_LEFT_OUT = {"mtllib", "usemtl", "o", "g", "s", "mg", "l", "p", "vp", "lod", "usemap", "maplib"}
_SIZES = {"v": 3, "vt": 2, "vn": 3}


def read_obj(data: bytes) -> Triangles:
    """The mesh in an OBJ file; `ValueError` with the end of a sentence if it has none."""
    points: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    corners: list[tuple[int, int, int]] = []
    counts: list[int] = []
    text = data.decode("latin-1").replace("\\\r\n", " ").replace("\\\n", " ")
    for number, line in enumerate(text.split("\n"), start=1):
        words = line.split("#", 1)[0].split()
        if not words or words[0] in _LEFT_OUT:
            continue
        keyword, *rest = words
        try:
            if keyword in points:
                point = [float(word) for word in rest[: _SIZES[keyword]]]
                # A texture coordinate may have u alone.
                if len(point) < _SIZES[keyword] and (keyword != "vt" or not point):
                    raise ValueError
                points[keyword].append(point if len(point) == _SIZES[keyword] else [*point, 0.0])
            elif keyword == "f":
                sizes = len(points["v"]), len(points["vt"]), len(points["vn"])
                corners.extend([_corner(word, sizes) for word in rest])
                counts.append(len(rest))
            else:
                raise ValueError
        except ValueError:
            raise ValueError(f"has a line {number} that cannot be used: {line.strip()[:60]!r}") from None
    check_counts(len(points["v"]), len(counts))
    if not counts:
        raise ValueError("has no faces")
    triples = np.array(corners, dtype=np.int64).reshape(-1, 3)
    return _welded(points, triples, np.array(counts, dtype=np.int64))


def _corner(word: str, sizes: tuple[int, int, int]) -> tuple[int, int, int]:
    """Numbers of position, texture coordinate and normal from 0; -1 for those that a corner lacks."""
    v, t, n = [*word.split("/"), "", ""][:3] if word.count("/") <= 2 else ("", "", "")
    return _index(v or "0", sizes[0]), _index(t, sizes[1]), _index(n, sizes[2])


def _index(word: str, size: int) -> int:
    """From 1, or from -1 for the latest so far."""
    if not word:
        return -1
    number = int(word)
    if number == 0 or abs(number) > size:
        raise ValueError
    return number - 1 if number > 0 else size + number


def _welded(points: dict[str, list[list[float]]], triples: np.ndarray, counts: np.ndarray) -> Triangles:
    """One vertex for each combination of position, texture coordinate and normal that occurs."""
    has = {key: bool((triples[:, n] >= 0).all()) for n, key in enumerate(points)}
    v, t, n = (triples[:, n] if has[key] else 0 * triples[:, n] for n, key in enumerate(points))
    widths = len(points["vt"]) + 1, len(points["vn"]) + 1
    _, first, corner = np.unique((v * widths[0] + t) * widths[1] + n, return_index=True, return_inverse=True)
    faces = fan_all(corner.ravel(), counts)
    position = np.array(points["v"])[v[first]]
    texcoord = np.array(points["vt"])[t[first]] if has["vt"] else None
    normal = np.array(points["vn"])[n[first]] if has["vn"] else None
    return Triangles.checked(position, faces, normal, texcoord)

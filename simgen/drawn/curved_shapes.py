"""Curved shapes as meshes, made of random numbers: bumpy blobs and heads, cones and vases, rings and knots.

A surface is a grid of points (rows, columns, 3) in units of about its own radius, which is written as a PLY
file of quads with texture coordinates, named after its content. Axes are the world's: Y down, Z forward.
"""

import hashlib
import math
from pathlib import Path
from random import Random

import numpy as np

from pcii.base import write_bytes_safely
from simgen.base import cache_folder
from simgen.drawn.composition import Table, log_uniform

ROWS, COLUMNS = 64, 128
HEADER = """ply
format binary_little_endian 1.0
element vertex {vertices}
property float x
property float y
property float z
property float s
property float t
element face {faces}
property list uchar int vertex_indices
end_header
"""


def mesh_folder() -> Path:
    """Where the files are; those that are there are not written again."""
    return cache_folder() / "meshes"


def mesh_of(points: np.ndarray, *sizes_mm: float) -> Table:
    """The mesh of a grid of points (rows, columns, 3); `sizes_mm` is the length of one unit, for each axis or
    for all three."""
    rows, columns, _ = points.shape
    right, up = np.meshgrid(np.linspace(0, 1, columns), np.linspace(1, 0, rows))
    vertices = np.concatenate([np.round(points, 4), right[..., None], up[..., None]], axis=-1).astype("<f4")
    corner = np.arange(rows * columns).reshape(rows, columns)
    quads = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1)
    faces = np.empty(quads[..., 0].size, [("count", "u1"), ("corners", "<i4", 4)])
    faces["count"], faces["corners"] = 4, quads.reshape(-1, 4)
    header = HEADER.format(vertices=rows * columns, faces=faces.size).encode()
    content = header + vertices.tobytes() + faces.tobytes()
    file = mesh_folder() / f"{hashlib.sha256(content).hexdigest()[:24]}.ply"
    if not file.exists():
        write_bytes_safely(file, content)
    scale = [round(size_mm, 2) for size_mm in sizes_mm]
    return {"type": "mesh", "file": file.name, "scale": scale if len(scale) > 1 else scale[0]}


def rod() -> np.ndarray:
    """An upright prism of 32 sides, of radius and half length 1, in pieces: rays are slow to trace between
    the long slivers of which a cylinder consists."""
    line = np.array([(0.0, -1.0), *((1.0, height) for height in np.linspace(-1, 1, 41)), (0.0, 1.0)])
    return _around(line, 32)


def blob(random: Random) -> np.ndarray:
    """A ball with bumps, stretched: waves over its surface, the shorter the lower."""
    directions = _globe()
    radius = np.ones(directions.shape[:2])
    strength, roughness = log_uniform(random, 0.05, 0.35), random.uniform(0.8, 1.8)
    for _ in range(12):
        frequency = log_uniform(random, 1, 8)
        wave = np.array([random.gauss(0, frequency) for _ in range(3)])
        height = strength * frequency**-roughness
        radius += height * np.sin(directions @ wave + random.uniform(0, 2 * math.pi))
    stretch = [log_uniform(random, 0.7, 1.3) for _ in range(3)]
    return directions * np.maximum(radius, 0.3)[..., None] * stretch


def head(random: Random) -> np.ndarray:
    """An egg that faces the cameras, with a nose, two hollows for eyes, a chin and a neck."""
    directions = _globe()
    radius = 1.0 + 0.05 * np.cos(3 * directions[..., 1])
    nose, eyes = random.uniform(0.2, 0.4), random.uniform(0.08, 0.18)
    features = [
        ((0.0, random.uniform(0.05, 0.2), -1.0), nose, 0.16),
        ((-0.35, -0.15, -0.9), -eyes, 0.2),
        ((0.35, -0.15, -0.9), -eyes, 0.2),
        ((0.0, 0.75, -0.65), random.uniform(0.0, 0.15), 0.25),
        ((-1.0, 0.0, 0.0), 0.15, 0.15),
        ((1.0, 0.0, 0.0), 0.15, 0.15),
        ((0.0, 1.0, 0.15), random.uniform(0.2, 0.9), 0.4),
    ]
    for place, height, width in features:
        away = np.linalg.norm(directions - np.array(place) / np.linalg.norm(place), axis=-1)
        radius += height * np.exp(-((away / width) ** 2))
    return directions * radius[..., None] * [random.uniform(0.7, 0.85), 1.0, random.uniform(0.8, 0.95)]


def spindle(random: Random) -> np.ndarray:
    """A cone, a capsule, a disc with a hole, a vase: a line that goes once around the upright axis."""
    kind = random.choice(["cone", "capsule", "annulus", "vase", "vase"])
    along = np.linspace(0, 1, ROWS)
    if kind == "cone":
        line = np.array([(0.0, -1.2), (log_uniform(random, 0.4, 1), 0.8), (0.0, 0.8)])
    elif kind == "capsule":
        angle = np.linspace(-math.pi / 2, math.pi / 2, ROWS)
        straight = random.uniform(0.3, 1.2) * np.sign(angle)
        line = 0.6 * np.stack([np.cos(angle), np.sin(angle) + straight], axis=-1)
    elif kind == "annulus":
        inner, half = random.uniform(0.3, 0.8), log_uniform(random, 0.03, 0.4)
        line = np.array([(inner, -half), (1.0, -half), (1.0, half), (inner, half), (inner, -half)])
    else:
        radius = random.uniform(0.35, 0.6) * np.ones(ROWS)
        for number in range(1, 4):
            radius += random.uniform(-0.25, 0.25) / number * np.cos(number * math.pi * along)
        side = np.stack([np.maximum(radius, 0.12), 2 * along - 1], axis=-1)
        line = np.concatenate([[(0.0, -1.0)], side, [(0.0, 1.0)]])
    if len(line) < ROWS:
        line = _evenly(line)
    return _around(line, COLUMNS)


def tube(random: Random) -> np.ndarray:
    """A ring, round or wavy, a knot or a spring: a circle that goes along a curve."""
    kind = random.choice(["ring", "ring", "wavy", "knot", "spring"])
    along, thick = np.linspace(0, 2 * math.pi, 4 * ROWS), log_uniform(random, 0.06, 0.4)
    radius, depth, turns = np.ones_like(along), 0 * along, 1
    if kind == "wavy":
        waves, height = random.randint(3, 8), random.uniform(0.05, 0.2)
        radius = radius + height * np.cos(waves * along)
        depth = height * np.sin(waves * along)
    elif kind == "knot":
        turns, waves, thick = 2, random.choice([3, 5, 7]), min(thick, 0.15)
        radius, depth = 0.75 + 0.3 * np.cos(waves * along), 0.3 * np.sin(waves * along)
    elif kind == "spring":
        turns, thick = random.randint(3, 6), min(thick, 0.12)
        radius, depth = 0.5 * radius, np.linspace(-1, 1, along.size)
    curve = np.stack([radius * np.cos(turns * along), radius * np.sin(turns * along), depth], axis=-1)
    forward = np.gradient(curve, axis=0)
    if kind != "spring":  # the curve closes
        forward[[0, -1]] = forward[0] + forward[-1]
    # Across the curve: away from the axis through the ring, and at right angles to both.
    outward = np.stack([np.cos(turns * along), np.sin(turns * along), 0 * along], axis=-1)
    sideways = _unit(np.cross(forward, outward))
    outward = _unit(np.cross(sideways, forward))
    angle = np.linspace(2 * math.pi, 0, ROWS // 2)[None, :, None]
    return curve[:, None] + thick * (np.cos(angle) * outward[:, None] + np.sin(angle) * sideways[:, None])


def _around(line: np.ndarray, columns: int) -> np.ndarray:
    """The surface (rows, columns + 1, 3) of a line (rows, 2) of radii and heights about the upright axis."""
    angle = np.linspace(-math.pi, math.pi, columns + 1)
    radius, height = (line[:, part, None] + 0 * angle for part in (0, 1))
    return np.stack([radius * np.sin(angle), height, -radius * np.cos(angle)], axis=-1)


def _globe() -> np.ndarray:
    """Directions (ROWS, COLUMNS + 1, 3) from the pole above to the one below, once around."""
    east, south = np.meshgrid(
        np.linspace(-math.pi, math.pi, COLUMNS + 1), np.linspace(-math.pi / 2, math.pi / 2, ROWS)
    )
    return np.stack([np.sin(east) * np.cos(south), np.sin(south), -np.cos(east) * np.cos(south)], axis=-1)


def _evenly(line: np.ndarray) -> np.ndarray:
    """`ROWS` points evenly along a line (N, 2)."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    even = np.linspace(0, length[-1], ROWS)
    return np.stack([np.interp(even, length, part) for part in line.T], axis=-1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)

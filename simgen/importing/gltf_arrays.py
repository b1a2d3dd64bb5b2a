"""Arrays of numbers and triangles of a glTF file (sections 3.6 and 3.7 of the specification)."""

from collections.abc import Mapping

import numpy as np

from simgen.assets.triangles import MOST_FACES, MOST_VERTICES, Triangles
from simgen.importing.gltf_file import GltfFile
from simgen.importing.gltf_models import Accessor, Primitive

_DTYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
TRIANGLES, STRIP, FAN = 4, 5, 6


def numbers(gltf: GltfFile, index: int, where: str, kind: str, most: int) -> np.ndarray:
    """The elements (N, C) of an accessor that must be of this type, such as "VEC3", and `most` at most.

    Integers that stand for shares become float32 from 0 or -1 to 1. Raises `InputError`, naming the accessor.
    """
    accessors = gltf.document.accessors
    if index >= len(accessors):
        raise gltf.fault(f"{where}: there is no accessors[{index}]")
    accessor, name = accessors[index], f"accessors[{index}]"
    if accessor.type != kind:
        raise gltf.fault(f"{where}: {name} is a {accessor.type}; a {kind} is needed")
    if accessor.count > most:
        raise gltf.fault(f"{name}: has {accessor.count} elements; at most {most} are read")
    dtype, size = np.dtype(_DTYPES[accessor.component_type]), _SIZES[kind]
    if accessor.buffer_view is None:
        values = np.zeros((accessor.count, size), dtype)
    else:
        values = _read(gltf, accessor.buffer_view, accessor.byte_offset, accessor.count, size, dtype, name)
    if accessor.sparse is not None:
        values = _replaced(gltf, values, accessor, name)
    if accessor.normalized and dtype.kind in "iu":
        return np.maximum(values / np.float32(np.iinfo(dtype).max), -1).astype(np.float32)
    return values


def _read(
    gltf: GltfFile, view: int, offset: int, count: int, size: int, dtype: np.dtype, name: str
) -> np.ndarray:
    content, stride = gltf.view(view, f"{name}.bufferView")
    width = size * dtype.itemsize
    step = stride or width
    end = offset + step * (count - 1) + width
    if end > len(content):
        raise gltf.fault(
            f"{name}: its {count} elements end at byte {end} of bufferViews[{view}], which has {len(content)}"
        )
    if step < width:
        raise gltf.fault(f"bufferViews[{view}].byteStride: {step} is less than an element's {width} bytes")
    rows = np.lib.stride_tricks.as_strided(content[offset:], (count, width), (step, 1), writeable=False)
    return np.ascontiguousarray(rows).view(dtype)


def _replaced(gltf: GltfFile, values: np.ndarray, accessor: Accessor, name: str) -> np.ndarray:
    sparse = accessor.sparse
    assert sparse is not None
    if sparse.count > accessor.count:
        raise gltf.fault(f"{name}.sparse: {sparse.count} of {accessor.count} elements are replaced")
    kind = np.dtype(_DTYPES[sparse.indices.component_type])
    if not sparse.count:
        return values
    which = _read(gltf, sparse.indices.buffer_view, sparse.indices.byte_offset, sparse.count, 1, kind, name)
    if which.max() >= accessor.count:
        raise gltf.fault(f"{name}.sparse: replaces element {which.max()} of {accessor.count}")
    size = values.shape[1]
    changed = values.copy()
    changed[which[:, 0]] = _read(
        gltf, sparse.values.buffer_view, sparse.values.byte_offset, sparse.count, size, values.dtype, name
    )
    return changed


def triangles_of(
    gltf: GltfFile,
    primitive: Primitive,
    texcoord: int | None,
    uv_matrix: np.ndarray,
    where: str,
    moved: np.ndarray | None = None,
) -> Triangles | None:
    """A primitive as triangles in its own axes and unit; None for points and lines, which have no surface.

    `moved` (N, 4, 4) are matrices that place each vertex of a skinned mesh. `texcoord` numbers the set of
    texture coordinates, which `uv_matrix` (3, 3) moves. The file's run down from the picture's upper left,
    ours up from its lower left.
    """
    if primitive.mode < TRIANGLES:
        return None
    attributes = primitive.attributes
    positions = _attribute(gltf, attributes, "POSITION", "VEC3", where)
    if positions is None:
        raise gltf.fault(f"{where}: it has no POSITION")
    normals = _attribute(gltf, attributes, "NORMAL", "VEC3", where)
    uv = None if texcoord is None else _attribute(gltf, attributes, f"TEXCOORD_{texcoord}", "VEC2", where)
    for values, name in ((normals, "NORMAL"), (uv, f"TEXCOORD_{texcoord}")):
        if values is not None and len(values) != len(positions):
            raise gltf.fault(f"{where}: {len(values)} elements of {name}, and {len(positions)} of POSITION")
    if moved is not None:
        if len(moved) != len(positions):
            raise gltf.fault(f"{where}: {len(moved)} elements of WEIGHTS_0, and {len(positions)} of POSITION")
        positions = np.einsum("nab,nb->na", moved[:, :3, :3], positions) + moved[:, :3, 3]
        if normals is not None:
            normals = np.einsum("nab,nb->na", moved[:, :3, :3], normals)
    if primitive.indices is None:
        corners = np.arange(len(positions))
    else:
        corners = numbers(gltf, primitive.indices, f"{where}.indices", "SCALAR", 3 * MOST_FACES)[:, 0]
        if corners.dtype.kind != "u":
            raise gltf.fault(f"{where}.indices: indices are unsigned whole numbers")
    faces = _faces(corners.astype(np.int64), primitive.mode)
    flat = (faces[:, 0] == faces[:, 1]) | (faces[:, 1] == faces[:, 2]) | (faces[:, 2] == faces[:, 0])
    if uv is not None:
        moved = np.column_stack([uv.astype(np.float64), np.ones(len(uv))]) @ uv_matrix[:2].T
        uv = moved * [1, -1] + [0, 1]
    if normals is not None and not np.linalg.norm(normals.astype(np.float64), axis=1).all():
        normals = None  # an exporter's normals of faces without area
    try:
        return Triangles.checked(positions, faces[~flat], normals, uv)
    except ValueError as fault:
        raise gltf.fault(f"{where}: {fault}") from None


def _attribute(
    gltf: GltfFile, attributes: Mapping[str, int], name: str, kind: str, where: str
) -> np.ndarray | None:
    if name not in attributes:
        return None
    return numbers(gltf, attributes[name], f"{where}.attributes.{name}", kind, MOST_VERTICES)


def _faces(corners: np.ndarray, mode: int) -> np.ndarray:
    if mode == TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    first = np.arange(max(len(corners) - 2, 0))
    if mode == FAN:
        return np.stack(
            [corners[first + 1], corners[first + 2], np.broadcast_to(corners[:1], first.shape)], -1
        )
    odd = first % 2  # of a strip every other triangle turns the other way
    return np.stack([corners[first], corners[first + 1 + odd], corners[first + 2 - odd]], axis=-1)

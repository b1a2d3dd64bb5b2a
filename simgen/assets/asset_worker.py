"""The process that decodes strangers' files: whatever they do to it, the parent lives.

It is started once for a scene. A line {"kind": ..., "path": ...} on standard input is answered on
standard output by a line of JSON, {"refused": "a sentence about it"} or {"arrays": [names]}, and
those arrays in NumPy's .npy format; nothing is pickled.
"""

import json
import os
import resource
import stat
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO

import numpy as np

MEMORY_BYTES = 1 << 31
SECONDS = 10
"""Longest time for one file: of the processor here, on the clock in the parent."""


def main() -> None:
    """Answer until standard input ends."""
    # Reserved, not used, by libraries as they load; set before the first stranger's byte is read.
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print must not end up among the answers
    for line in sys.stdin:
        job = json.loads(line)
        used = resource.getrusage(resource.RUSAGE_SELF)
        spent = int(used.ru_utime + used.ru_stime)
        resource.setrlimit(resource.RLIMIT_CPU, (spent + SECONDS + 1, resource.RLIM_INFINITY))
        _answer(answers, job["kind"], Path(job["path"]))
        answers.flush()


def _answer(answers: BinaryIO, kind: str, path: Path) -> None:
    try:
        arrays = dict(_decode(kind, path))
        head = {"arrays": list(arrays)}
    except MemoryError:
        arrays, head = {}, {"refused": f"this file takes more than {MEMORY_BYTES >> 20} MiB to read"}
    except ValueError as fault:
        sentence, named = str(fault), f"{path}: "
        refused = sentence.removeprefix(named) if sentence.startswith(named) else f"this file {sentence}"
        arrays, head = {}, {"refused": refused}
    except Exception as fault:  # decoders raise whatever they like
        arrays, head = {}, {"refused": f"this file cannot be read ({type(fault).__name__}: {fault})"}
    answers.write(json.dumps(head).encode() + b"\n")
    # Nothing but write(): of a true file NumPy asks the position, which a pipe has not.
    pipe: Any = SimpleNamespace(write=answers.write)
    for array in arrays.values():
        np.lib.format.write_array(pipe, np.ascontiguousarray(array), allow_pickle=False)


def _decode(kind: str, path: Path) -> Iterator[tuple[str, np.ndarray]]:
    if kind == "environment":
        from simgen.assets.image_files import read_environment

        yield "pixels", read_environment(path)
    elif kind in ("image", "picture with alpha"):
        from simgen.assets.image_files import read_texture

        yield "pixels", read_texture(path, alpha=kind != "image")
    else:
        from simgen.assets.obj_files import read_obj
        from simgen.assets.ply_files import read_ply

        readers = {".ply": read_ply, ".obj": read_obj}
        if path.suffix.lower() not in readers:
            raise ValueError("is not named .ply or .obj, the kinds of mesh that are read")
        mesh = readers[path.suffix.lower()](_bytes(path))
        yield "positions", mesh.positions
        yield "faces", mesh.faces
        if mesh.normals is not None:
            yield "normals", mesh.normals
        if mesh.texcoords is not None:
            yield "texcoords", mesh.texcoords


def _bytes(path: Path) -> bytes:
    number = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    with open(number, "rb") as file:  # noqa: PTH123 - of a number, not of a path
        if not stat.S_ISREG(os.fstat(number).st_mode):
            raise ValueError("is not a plain file")
        return file.read()

"""Files that a scene brings along, as plain arrays: decoded in a process of their own that may die."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any

import numpy as np
from pydantic import BaseModel

from pcii.base.errors import InputError
from pcii.base.srgb import srgb_to_linear
from simgen.assets.asset_worker import SECONDS
from simgen.assets.triangles import Triangles
from simgen.base.asset_names import AssetName, EnvironmentName, ImageName, MeshName, asset, named_files
from simgen.base.strict_models import shorten

LARGEST_TOTAL_BYTES = 1 << 30
_KINDS: dict[type[AssetName], str] = {ImageName: "image", EnvironmentName: "environment", MeshName: "mesh"}
# The parent's own search path, so that the same code runs; isolated, so that none of the working
# directory's does.
_START = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from simgen.assets.asset_worker import main; main()"
)


@dataclass(frozen=True)
class Assets:
    """The files of one scene, by the names that the scene gives them."""

    _images: Mapping[str, np.ndarray] = field(default_factory=dict)
    _environments: Mapping[str, np.ndarray] = field(default_factory=dict)
    _meshes: Mapping[str, Triangles] = field(default_factory=dict)

    def image(self, name: str) -> np.ndarray:
        """A texture as linear RGB, (H, W, 3) float32 from 0 to 1."""
        pixels = self._images[name]
        largest = np.iinfo(pixels.dtype).max
        return srgb_to_linear(np.arange(largest + 1) / largest).astype(np.float32)[pixels]

    def stored(self, name: str) -> np.ndarray:
        """What an image holds, without the sRGB curve: (H, W, 3) float32 from 0 to 1."""
        pixels = self._images[name]
        return pixels / np.float32(np.iinfo(pixels.dtype).max)

    def numbers(self, name: str, where: str) -> np.ndarray:
        """What a grey image holds, (H, W, 1) float32 from 0 to 1.

        `InputError`, beginning with `where`, if it is coloured.
        """
        pixels = self.stored(name)
        if (pixels != pixels[..., :1]).any():
            raise InputError(
                f"{where}: {name!r} is coloured; save the one channel that is meant as a grey image"
            )
        return pixels[..., :1]

    def environment(self, name: str) -> np.ndarray:
        """Light from all around as linear RGB, (H, W, 3) float32, finite and not negative."""
        return self._environments[name]

    def mesh(self, name: str) -> Triangles:
        """A mesh in the file's own unit."""
        return self._meshes[name]


def read_assets(scene: BaseModel, folder: Path) -> Assets:
    """Decode every file that a scene names. Raises `InputError` for the first that cannot be used.

    The files are strangers': a process with limits of memory and time reads them, once each, and is
    not even started for a scene without files.
    """
    found: dict[str, dict[str, Any]] = {kind: {} for kind in _KINDS.values()}
    wanted = {
        (_KINDS[type(name)], str(name)): asset(folder, name, w)
        for w, name in named_files(scene)
        if type(name) in _KINDS
    }
    if wanted:
        total = 0
        with _Worker() as worker:
            for (kind, name), path in wanted.items():
                arrays = worker.read(kind, path)
                total += sum(array.nbytes for array in arrays.values())
                if total > LARGEST_TOTAL_BYTES:
                    raise InputError(
                        f"{path}: with this file the scene's files take more than {LARGEST_TOTAL_BYTES} bytes"
                    )
                found[kind][name] = Triangles(**arrays) if kind == "mesh" else arrays["pixels"]
    return Assets(found["image"], found["environment"], found["mesh"])


def read_environment(path: Path) -> np.ndarray:
    """An OpenEXR picture as linear RGB, (H, W, 3) float32, finite and not negative, or `InputError`."""
    with _Worker() as worker:
        return worker.read("environment", path)["pixels"]


def read_pictures(paths: Iterable[Path]) -> Iterator[np.ndarray]:
    """Pictures as sRGB (H, W, 3), or with alpha (H, W, 4), uint8 or uint16; `InputError` as of textures."""
    with _Worker() as worker:
        for path in paths:
            yield worker.read("picture with alpha", path)["pixels"]


def read_meshes(paths: Iterable[Path]) -> Iterator[Triangles]:
    """PLY and OBJ meshes in the files' own units, each as it is asked for; `InputError` for a bad one."""
    with _Worker() as worker:
        for path in paths:
            yield Triangles(**worker.read("mesh", path))


class _Worker:
    """The process that decodes, and the clock that ends it."""

    def __enter__(self) -> "_Worker":
        command = [sys.executable, "-I", "-c", _START, json.dumps([*filter(None, sys.path)])]
        pipe, nowhere = subprocess.PIPE, subprocess.DEVNULL
        # One thread: each would reserve memory of the worker's allowance.
        alone = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            command, stdin=pipe, stdout=pipe, stderr=nowhere, env=os.environ | alone
        )
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()

    def read(self, kind: str, path: Path) -> dict[str, np.ndarray]:
        """The arrays of one file; `InputError` if it is refused, or ends or outlasts the process."""
        late = threading.Event()

        def end() -> None:
            late.set()
            self._process.kill()

        clock = threading.Timer(SECONDS, end)
        clock.start()
        try:
            refused, arrays = self._ask(kind, path)
        except (OSError, EOFError, ValueError):  # the answer breaks off
            why = (
                f"takes longer than {SECONDS} s to read"
                if late.is_set()
                else "ends the process that reads it"
            )
            raise InputError(f"{path}: this file {why}; save it anew, smaller or simpler") from None
        finally:
            clock.cancel()
        if refused is not None:
            raise InputError(f"{path}: {shorten(refused)}")
        return arrays

    def _ask(self, kind: str, path: Path) -> tuple[str | None, dict[str, np.ndarray]]:
        questions, answers = _open(self._process.stdin), _open(self._process.stdout)
        questions.write(json.dumps({"kind": kind, "path": str(path)}).encode() + b"\n")
        questions.flush()
        head = json.loads(answers.readline(1 << 16))
        if "refused" in head:
            return str(head["refused"]), {}
        # Nothing but read(): of a true file NumPy asks the position, which a pipe has not.
        pipe: Any = SimpleNamespace(read=answers.read)
        return None, {name: np.lib.format.read_array(pipe, allow_pickle=False) for name in head["arrays"]}


def _open(stream: IO[bytes] | None) -> IO[bytes]:
    assert stream is not None
    return stream

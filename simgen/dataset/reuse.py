"""What datasets that are made one after another have in common, made once.

Datasets of one scene share the scene in the renderer; with the same cameras the truth too; and if they
differ in their seed alone also what is found out about the light before photons are drawn. Nothing of it
depends on which of them is made first.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pcii.store.hashes import hash_json
from pcii.store.safe_files import new_folder_safely
from simgen.dataset.prepared import Prepared, least_samples
from simgen.photons.counting_plan import Plan
from simgen.renderer.mitsuba_scene import RenderScene

Made = TypeVar("Made")

MOST_FOLDER_BYTES = 1 << 26
"""Larger folders are made anew rather than held in memory."""


class Reuse:
    """The last thing made of each kind, with the key that says what it was made from."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[str, Any]] = {}

    def once(self, kind: str, key: str, make: Callable[[], Made]) -> Made:
        """The last thing of this kind if it has this key, else what `make` gives."""
        if self._last.get(kind, ("", None))[0] != key:
            self._last.pop(kind, None)  # before another as large is made
            self._last[kind] = key, make()
        return self._last[kind][1]

    def folder(self, kind: str, key: str, folder: Path, make: Callable[[], None]) -> None:
        """See that `folder` exists: left as it is, or a copy of the last one of this key, or by `make`."""
        if folder.is_dir():
            return
        known, files = self._last.get(kind, ("", {}))
        if known == key:
            with new_folder_safely(folder) as temporary:
                for name, content in files.items():
                    (temporary / name).parent.mkdir(parents=True, exist_ok=True)
                    (temporary / name).write_bytes(content)
            return
        self._last.pop(kind, None)
        make()
        files = [file for file in folder.rglob("*") if file.is_file()]
        if sum(file.stat().st_size for file in files) <= MOST_FOLDER_BYTES:
            contents = {file.relative_to(folder).as_posix(): file.read_bytes() for file in files}
            self._last[kind] = key, contents


@dataclass(frozen=True)
class InCommon:
    """What one dataset may have in common with those before it, with the keys of what that depends on."""

    reuse: Reuse
    scene_key: str
    truth_key: str
    light_key: str

    def scene(self, make: Callable[[], RenderScene]) -> RenderScene:
        """The scene in the renderer."""
        return self.reuse.once("scene", self.scene_key, make)

    def plan(self, make: Callable[[], Plan]) -> Plan:
        """How photon counts will be made, with what was found out about the light for that."""
        return self.reuse.once("plan", self.light_key, make)

    def truth(self, folder: Path, make: Callable[[], None]) -> None:
        """The truth's folder."""
        self.reuse.folder("truth", self.truth_key, folder, make)


def in_common(reuse: Reuse, prepared: Prepared, engine: dict[str, Any]) -> InCommon:
    """What a dataset may have in common with those before it; `engine` describes the backend."""
    recipe = prepared.recipe
    values = recipe.model_dump(mode="json")
    scene = hash_json([prepared.scene_content, recipe.render.max_depth, engine["variant"]])
    # Errors of cameras are drawn from the seed.
    cameras = hash_json([scene, values["grid"], None if recipe.grid.errors is None else recipe.seed])
    light = "sensor", "photons", "exposure"
    return InCommon(
        reuse,
        scene_key=scene,
        truth_key=hash_json([cameras, values["products"], values["analysis"]["z_mm"]]),
        light_key=hash_json([cameras, [values[part] for part in light], least_samples(recipe)]),
    )

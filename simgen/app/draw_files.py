"""One draw of a distribution of scenes, written as a scene of its own."""

import shutil
from pathlib import Path

import tomli_w

from pcii.store.folder_kind import check_free
from pcii.store.safe_files import new_folder_safely
from simgen.base.asset_names import asset
from simgen.spec.scene import load_scene, scene_files


def write_drawn_scene(name_or_path: str, number: int, out: Path) -> Path:
    """Write one draw of a distribution as a scene folder: scene.toml, whose path is returned, and its assets.

    Raises `InputError` for what is no distribution, or a folder that holds anything.
    """
    scene, folder = load_scene(name_or_path, number=number)
    check_free(out, "scene")
    values = scene.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    out.parent.mkdir(parents=True, exist_ok=True)
    with new_folder_safely(out) as temporary:
        for where, name in scene_files(scene):
            copy = temporary / name
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(asset(folder, name, where), copy)
        (temporary / "scene.toml").write_text(tomli_w.dumps(values, multiline_strings=True), encoding="utf-8")
    return out / "scene.toml"

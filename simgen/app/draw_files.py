"""One draw of a distribution of scenes, written as a scene of its own."""

from pathlib import Path

from pcii.store.folder_kind import check_free
from pcii.store.safe_files import new_folder_safely
from simgen.spec.scene import load_scene


def write_drawn_scene(name_or_path: str, number: int, out: Path) -> Path:
    """Write one draw of a distribution as a scene folder: scene.toml, whose path is returned, and its assets.

    Raises `InputError` for what is no distribution, or a folder that holds anything.
    """
    scene, _ = load_scene(name_or_path, number=number)
    check_free(out, "scene")
    out.parent.mkdir(parents=True, exist_ok=True)
    with new_folder_safely(out) as temporary:
        scene.save(temporary)
    return out / "scene.toml"

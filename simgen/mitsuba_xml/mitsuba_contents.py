"""Files that the shapes and lights of a Mitsuba scene name, read once each."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TypeVar

from pcii.base.errors import InputError
from simgen.base.asset_names import asset
from simgen.mitsuba_xml.mitsuba_scene import MitsubaScene, Plugin

Content = TypeVar("Content")


def read_named(
    scene: MitsubaScene,
    types: Iterable[str],
    read: Callable[[Iterable[Path]], Iterator[Content]],
    size: Callable[[Content], int],
    most: int,
    what: str,
) -> dict[str, Content]:
    """What is in the files that plugins of some types name, by these names.

    Raises `InputError` for one that cannot be read, and for more of them than `most`, which is in `what`.
    """
    names = dict.fromkeys(
        str(plugin.parameters["filename"]) for plugin in _used_plugins(scene) if plugin.type in types
    )
    paths = {name: asset(scene.path.parent, name, str(scene.path)) for name in names}
    if not paths:
        return {}  # without a process that would read nothing
    contents, total = {}, 0
    for (name, path), content in zip(paths.items(), read(paths.values()), strict=True):
        contents[name] = content
        total += size(content)
        if total > most:
            raise InputError(
                f"{path}: with this file the scene has more than {most} {what}; make some smaller"
            )
    return contents


def _used_plugins(scene: MitsubaScene) -> Iterator[Plugin]:
    """All plugins of shapes and lights, each once, in the order of the file."""
    waiting = [plugin for plugin in scene.plugins if plugin.category in ("shape", "emitter")][::-1]
    seen = set[Plugin]()
    while waiting:
        plugin = waiting.pop()
        if plugin not in seen:
            seen.add(plugin)
            yield plugin
            nested = [value for value in plugin.parameters.values() if isinstance(value, Plugin)]
            waiting += [*nested, *plugin.parts][::-1]

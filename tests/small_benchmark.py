"""A benchmark of two small scenes, for the tests of making it and of scoring on it."""

from pathlib import Path
from typing import Any

import tomli_w

from simgen.dataset import Definition, load_definition

SMALL = {"grid.rows": 2, "grid.cols": 2, "grid.height": 66, "grid.width": 70, "grid.pixel_mm": 0.5}
SCENE = {"kind": "separate", "half": "development", "recipe": "plain_pair"}
DEFINITION: dict[str, Any] = {
    "name": "small",
    "title": "two scenes",
    "photons_per_view": [30, 1000],
    "brighter_photons_per_view": [3000],
    "seeds": [1, 2, 3],
    "frames": 200,
    "set": [*(f"{name}={value}" for name, value in SMALL.items()), "render.samples_per_pixel=1"],
    "publication": {"licence": "CC-BY-4.0"},
    "scene": [
        SCENE | {"name": "pair", "frames": True},
        SCENE | {"name": "wall", "kind": "nothing", "half": "test", "recipe": "blank"},
    ],
}


def written(folder: Path, **changes: Any) -> tuple[Definition, Path]:
    file = folder / "benchmarks" / "small.toml"
    file.parent.mkdir(exist_ok=True, parents=True)
    file.write_text(tomli_w.dumps(DEFINITION | changes))
    return load_definition(str(file))

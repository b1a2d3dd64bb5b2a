"""README.md of a dataset or collection: what it is, how to open it, and under what terms it may be used.

It depends on the data and the terms alone, and no manifest lists it: other terms make no other dataset.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcii.base.plain_text import in_markdown
from pcii.base.safe_files import temporaries_of, write_bytes_safely
from pcii.store.collection import is_collection, read_collection, read_index
from pcii.store.dataset_layout import CARD, read_manifest

PROJECT = "photon-integral-imaging"
LICENCE = "BSD-3-Clause"
"""Licence of this software and of the scenes that come with it, and of data unless another one is named."""
CREATOR = "The photon-integral-imaging authors"
CITATION = (
    "Photon-starved integral imaging: physically based data, reconstruction and defocus removal "
    f"({PROJECT}). {CREATOR}."
)
"""As CITATION.cff has it."""
INSTALL = f"import pcii  # pip install {PROJECT}"
"""A README.md without this line is somebody else's."""
HOW_TO_READ = """```python
{install}

{example}
dataset.counts, dataset.truth, dataset.views, dataset.grid
```

X points right, Y down, Z forward, in millimetres; `z` is planar depth. Each array says its axes, unit and
meaning in its attributes. `manifest.json` has the recipe, from which `simgen generate` makes the same data,
and the SHA-256 of every file, with which `simgen verify` compares them."""


@dataclass(frozen=True)
class Terms:
    """Licence, a name of the SPDX list or a URL; who made the data; how to cite them; where they are."""

    licence: str = LICENCE
    creators: tuple[str, ...] = (CREATOR,)
    citation: str = CITATION
    url: str = ""


def write_card(root: Path, terms: Terms) -> None:
    """Write README.md of a finished dataset or of a collection; `InputError` for a folder that is neither.

    An earlier one is replaced, and one that somebody else has written is left alone. Nothing is written where
    it is there already, so that a folder that is read-only will do.
    """
    parts = _of_collection(root) if is_collection(root) else _of_dataset(root)
    text = "\n\n".join(part for part in (*parts, *_terms(terms)) if part) + "\n"
    content = text.encode(errors="backslashreplace")
    file = root / CARD
    if file.is_file():
        present = file.read_bytes()
        is_written = present == content and not temporaries_of(root, CARD)
        if is_written or INSTALL.encode() not in present:
            return
    for temporary in temporaries_of(root, CARD):
        temporary.unlink()
    write_bytes_safely(file, content)


def _of_dataset(root: Path) -> list[str]:
    manifest = read_manifest(root)
    grid, recipe = manifest.grid, manifest.recipe
    scene = f" of the scene {name}" if (name := recipe.get("scene")) else ""
    pattern = f"Bayer pattern {manifest.cfa}" if manifest.cfa else "no colour filters"
    photons = (manifest.photons or {}).get("total")
    total = "" if photons is None else f" {photons} photons were counted in all."
    objects = ", ".join(in_markdown(str(name)) for name in manifest.objects.values())
    return [
        f"# {in_markdown(manifest.title or 'Integral images')}",
        f"Integral imaging in little light: {grid.rows} x {grid.cols} views of {grid.height} x "
        f"{grid.width} pixels{in_markdown(scene)}, {pattern}.{total}",
        f"Objects: {objects}." if objects else "",
        HOW_TO_READ.format(install=INSTALL, example='dataset = pcii.open_dataset("FOLDER")'),
    ]


def _of_collection(root: Path) -> list[str]:
    document, rows = read_collection(root), read_index(root)
    recipe = document.recipe
    title = recipe.get("title") or f"Integral images of {recipe.get('scene') or 'many scenes'}"
    differing = "; ".join(_values_of(field, rows) for field in document.fields)
    return [
        f"# {in_markdown(title)}",
        f"A collection of {len(rows)} datasets of integral imaging in little light, made by simulation: a "
        "folder for each, `collection.json` (the recipe that all have in common) and `index.jsonl` (a line "
        "for each dataset).",
        f"What differs between them: {differing}.",
        HOW_TO_READ.format(install=INSTALL, example='dataset = pcii.open_collection("FOLDER")[0]'),
    ]


def _values_of(field: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """The values of a field, some of them where there are many."""
    values = list(dict.fromkeys(json.dumps(row["values"][field], ensure_ascii=False) for row in rows))
    shown = values if len(values) <= 6 else [*values[:3], "...", values[-1]]
    return f"`{field}` ({len(values)} values: {', '.join(in_markdown(value) for value in shown)})"


def _terms(terms: Terms) -> list[str]:
    return [
        f"Licence: {in_markdown(terms.licence)}. "
        f"By {', '.join(in_markdown(name) for name in terms.creators)}. Please cite:",
        f"> {in_markdown(terms.citation)}",
        f"Where: {in_markdown(terms.url)}" if terms.url else "",
    ]

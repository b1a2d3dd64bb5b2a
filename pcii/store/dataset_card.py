"""README.md of a dataset or collection: what it is, how to open it, and under what terms it may be used.

It depends on the data and the terms alone, and no manifest lists it: other terms make no other dataset.
LICENSE has the terms alone, where programs that collect data look for them.
"""

from dataclasses import dataclass
from pathlib import Path

from pcii.base.plain_text import in_markdown, visible, web_address
from pcii.base.safe_files import locked, temporaries_of, write_bytes_safely
from pcii.store.collection import COLLECTION, is_collection, read_collection, read_index
from pcii.store.dataset_layout import CARD, MANIFEST, read_manifest
from pcii.store.dataset_layout import LICENCE as LICENCE_FILE

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
TEXT = """# {title}

{content}

```python
{install}

{example}
dataset.counts, dataset.truth, dataset.views, dataset.grid
```

X points right, Y down, Z forward, in millimetres; `z` is planar depth. Each array says its axes, unit and
meaning in its attributes. The manifest has the recipe, from which `simgen generate` makes the same data, and
the SHA-256 of every file, with which `simgen verify` compares them.

Licence: {licence}. By {creators}. Please cite:

> {citation}
"""
OPENING = "The data in this folder may be used under the terms of"
"""A LICENSE without this line is somebody else's."""
LICENCE_TEXT = """{opening} {licence}:
{address}

By {creators}. Please cite:

{citation}
"""


@dataclass(frozen=True)
class Terms:
    """Licence, a name of the SPDX list or a URL; who made the data; how to cite them; where they are."""

    licence: str = LICENCE
    creators: tuple[str, ...] = (CREATOR,)
    citation: str = CITATION
    url: str = ""

    @property
    def address(self) -> str:
        """Address of the licence."""
        return web_address(self.licence) or web_address(f"https://spdx.org/licenses/{self.licence}.html")

    @property
    def reference(self) -> str:
        """How to cite the data, and where they are."""
        return f"{self.citation} {self.url}".strip()


def write_card(root: Path, terms: Terms) -> None:
    """Write README.md of a finished dataset or of a collection; `InputError` for a folder that is neither.

    An earlier one is replaced, and one that somebody else has written is left alone. Nothing is written where
    it is there already, so that a folder that is read-only will do.
    """
    if is_collection(root):
        fields = ", ".join(read_collection(root).fields)
        title = str(read_collection(root).recipe.get("title") or "Integral images")
        example = 'dataset = pcii.open_collection("FOLDER")[0]'
        content = f"A collection of {len(read_index(root))} datasets, which differ in {in_markdown(fields)}."
    else:
        manifest, example = read_manifest(root), 'dataset = pcii.open_dataset("FOLDER")'
        title, grid = manifest.title or "Integral images", manifest.grid
        pattern = f"Bayer pattern {manifest.cfa}" if manifest.cfa else "no colour filters"
        content = f"{grid.rows} x {grid.cols} views of {grid.height} x {grid.width} pixels, {pattern}."
    text = TEXT.format(
        title=in_markdown(title),
        content=f"Integral imaging in little light. {content}",
        install=INSTALL,
        example=example,
        licence=f"[{in_markdown(terms.licence)}](<{terms.address}>)",
        creators=", ".join(in_markdown(name) for name in terms.creators),
        citation=in_markdown(terms.reference),
    )
    _write(root, CARD, text, INSTALL)


def write_licence(root: Path, terms: Terms) -> None:
    """Write LICENSE of a finished dataset or of a collection, on the conditions of `write_card`."""
    text = LICENCE_TEXT.format(
        opening=OPENING,
        licence=visible(terms.licence),
        address=terms.address,
        creators=", ".join(map(visible, terms.creators)),
        citation=visible(terms.reference),
    )
    _write(root, LICENCE_FILE, text, OPENING)


def _write(root: Path, name: str, text: str, mark: str) -> None:
    """Write a file of this text, unless there is one without `mark`."""
    encoded, file = text.encode(errors="backslashreplace"), root / name
    if file.is_file():
        present = file.read_bytes()
        is_written = present == encoded and not temporaries_of(root, name)
        if is_written or mark.encode() not in present:
            return
    with locked(root / (COLLECTION if is_collection(root) else MANIFEST), root):
        for temporary in temporaries_of(root, name):  # of a command that was killed
            temporary.unlink()
        write_bytes_safely(file, encoded)

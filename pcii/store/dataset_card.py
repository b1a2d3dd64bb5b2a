"""README.md of a dataset or collection: what it is, how to open it, and under what terms it may be used.

It depends on the data and the terms alone, and no manifest lists it: other terms make no other dataset.
LICENSE has the terms alone, where programs that collect data look for them.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from pcii.base import in_markdown, locked, temporaries_of, visible, write_bytes_safely
from pcii.store.collection import is_collection, read_index
from pcii.store.folders import COLLECTION, COLLECTION_FOLDER, MANIFEST, read_manifest

CARD, LICENCE = "README.md", "LICENSE"
PROJECT = "photon-integral-imaging"
SOFTWARE = (
    "Photon-starved integral imaging: physically based data, reconstruction and defocus removal "
    f"({PROJECT}). The photon-integral-imaging authors."
)
"""How to cite the software that made the data, as CITATION.cff has it."""
MOST_NAMED = 3
"""Largest number of scenes in the title of a collection without one."""
INSTALL = f"import pcii  # pip install {PROJECT}"
"""A README.md without this line is somebody else's."""
OPENING = "The data in this folder may be used under the terms of"
"""A LICENSE without this line is somebody else's."""


OF_ADDRESSES = "%/:?#[]@!$&'()*+,;=~"
"""What addresses of the web hold beside letters, digits and - . _ as it is."""


@dataclass(frozen=True)
class Terms:
    """Licence, a name of the SPDX list or a URL; who made the data; how to cite them; where they are.

    What is empty is not known, and nothing is put in its place.
    """

    licence: str = ""
    creators: tuple[str, ...] = ()
    citation: str = ""
    url: str = ""

    @property
    def address(self) -> str:
        """Address of the licence, with what addresses cannot hold percent-encoded.

        >>> Terms("CC-BY-4.0").address, Terms("https://example.org/a b").address
        ('https://spdx.org/licenses/CC-BY-4.0.html', 'https://example.org/a%20b')
        """
        is_address = re.match("https?://", self.licence, re.IGNORECASE)
        address = self.licence if is_address else f"https://spdx.org/licenses/{self.licence}.html"
        return quote(address, safe=OF_ADDRESSES, errors="backslashreplace")

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
        collection, rows = COLLECTION_FOLDER.read(root), read_index(root)
        scenes = list(dict.fromkeys(row["scene"] for row in rows if row["scene"]))
        names = ", ".join(scenes) if len(scenes) <= MOST_NAMED else f"{len(scenes)} scenes"
        title = str(collection.recipe.get("title") or names or "Integral images")
        example = 'dataset = pcii.open_collection("FOLDER")[0]'
        fields = in_markdown(", ".join(collection.fields))
        content = f"A collection of {len(rows)} datasets, which differ in {fields}."
    else:
        manifest, example = read_manifest(root), 'dataset = pcii.open_dataset("FOLDER")'
        title, grid = manifest.title or "Integral images", manifest.grid
        pattern = f"Bayer pattern {manifest.cfa}" if manifest.cfa else "no colour filters"
        content = f"{grid.rows} x {grid.cols} views of {grid.height} x {grid.width} pixels, {pattern}."
    text = f"""# {in_markdown(title)}

Integral imaging in little light. {content}

```python
{INSTALL}

{example}
dataset.counts, dataset.truth, dataset.views, dataset.grid
```

X points right, Y down, Z forward, in millimetres; `z` is planar depth. Each array says its axes, unit and
meaning in its attributes. The manifest has the recipe, from which `simgen generate` makes the same data, and
the SHA-256 of every file, with which `simgen verify` compares them.

{_terms_in_markdown(terms)}

Made with

> {SOFTWARE}
"""
    _write(root, CARD, text, INSTALL)


def _terms_in_markdown(terms: Terms) -> str:
    """Licence, creators and citation in sentences, and what of them nobody has stated."""
    sentences = ["Licence: none is stated. Ask whoever made the data before you use them."]
    if terms.licence:
        sentences = [f"Licence: [{in_markdown(terms.licence)}](<{terms.address}>)."]
    if terms.creators:
        sentences.append(f"By {', '.join(in_markdown(name) for name in terms.creators)}.")
    if not terms.reference:
        return " ".join(sentences)
    return f"{' '.join(sentences)} Please cite:\n\n> {in_markdown(terms.reference)}"


def write_licence(root: Path, terms: Terms) -> None:
    """Write LICENSE of a finished dataset or of a collection, on the conditions of `write_card`.

    The licence has to be known.
    """
    lines = [f"{OPENING} {visible(terms.licence)}:\n{terms.address}"]
    if terms.creators:
        lines.append(f"By {', '.join(map(visible, terms.creators))}.")
    if terms.reference:
        lines.append(f"Please cite:\n\n{visible(terms.reference)}")
    _write(root, LICENCE, "\n\n".join(lines) + "\n", OPENING)


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

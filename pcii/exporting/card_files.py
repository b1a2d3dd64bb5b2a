"""README.md and croissant.json of a dataset or collection, written beside its files.

They depend on the data and the terms alone: no dates, nothing of the run. No manifest lists them, so that
other terms do not make another dataset; `simgen verify` compares them by the checksum in croissant.json.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.core.array_labels import COUNTS_LABELS, PHOTON_TRUTH_LABELS, TRUTH_LABELS, Label
from pcii.exporting.croissant_document import MANIFESTS, Description, ManifestField, croissant
from pcii.exporting.dataset_card import (
    card_of_collection,
    card_of_dataset,
    collection_summary,
    dataset_summary,
)
from pcii.exporting.publication_terms import Terms
from pcii.io.collection_layout import COLLECTION, INDEX, is_collection, read_collection, read_index
from pcii.io.dataset_layout import (
    CARD,
    COUNTS,
    CROISSANT,
    MANIFEST,
    PHOTON_TRUTH,
    RADIANCE,
    TRUTH,
    read_manifest,
)
from pcii.store.file_list import list_files
from pcii.store.hashes import hash_bytes
from pcii.store.safe_files import locked, temporaries_of, write_bytes_safely
from pcii.store.sealed_json import read_sealed, write_sealed

JSON, JSON_LINES, ZARR, EXR = (
    "application/json",
    "application/jsonl",
    "application/octet-stream",
    "image/x-exr",
)
KINDS = {bool: "sc:Boolean", int: "sc:Integer", float: "sc:Float", str: "sc:Text"}
FIELDS = (
    ManifestField("title", "$.title", "sc:Text", "title"),
    ManifestField("scene", "$.recipe.scene", "sc:Text", "scene"),
    ManifestField("seed", "$.recipe.seed", "sc:Integer", "seed of all that is random"),
    ManifestField("photons", "$.photons.total", "sc:Integer", "photons in all views"),
    ManifestField("identity", "$.identity", "sc:Text", "hash of all that decides the data"),
)
GROUPS = {COUNTS: COUNTS_LABELS, PHOTON_TRUTH: PHOTON_TRUTH_LABELS, TRUTH: TRUTH_LABELS}


def write_card(root: Path, terms: Terms) -> None:
    """Write the card of a finished dataset or of a collection; a former one is replaced.

    Raises `InputError` for a folder that is neither, and for one that has another README.md.
    """
    card, said = (_of_collection if is_collection(root) else _of_dataset)(root, terms)
    content = card.encode(errors="backslashreplace")
    entry = {"bytes": len(content), "sha256": hash_bytes(content)}
    document = croissant(replace(said, files={CARD: entry, **said.files}), terms)
    if _is_written(root, content, document) and not temporaries_of(root, CARD, CROISSANT):
        return
    if (root / CARD).exists() and not (root / CROISSANT).exists():
        raise InputError(f"{root / CARD}: is not a card of this dataset's; move it away")
    with locked(root / (COLLECTION if is_collection(root) else MANIFEST), wait=True):
        for left in temporaries_of(root, CARD, CROISSANT):
            left.unlink()
        write_sealed(root / CROISSANT, document)
        write_bytes_safely(root / CARD, content)


def _is_written(root: Path, card: bytes, document: Mapping[str, Any]) -> bool:
    """Whether the files are there with this content; then even a folder that is read-only will do."""
    try:
        return (root / CARD).read_bytes() == card and read_sealed(root / CROISSANT, "") == document
    except (OSError, InputError):
        return False


def _of_dataset(root: Path, terms: Terms) -> tuple[str, Description]:
    manifest = read_manifest(root)
    title, arrays = manifest.get("title") or "Integral images", stored_arrays(manifest["files"])
    said = Description(
        title=title,
        text=dataset_summary(manifest),
        identity=str(manifest.get("identity")),
        files=manifest["files"],
        file_sets={MANIFESTS: (MANIFEST, JSON)},
        fields=[field for field in FIELDS if _has(manifest, field.path)],
        arrays=arrays,
    )
    return card_of_dataset(title, manifest, arrays, terms), said


def _of_collection(root: Path, terms: Terms) -> tuple[str, Description]:
    document, rows = read_collection(root), read_index(root)
    recipe = document.get("recipe", {})
    title = recipe.get("title") or f"Integral images of {recipe.get('scene') or 'many scenes'}"
    identities = "".join(sorted(str(row.get("identity")) for row in rows))
    swept = [
        ManifestField(name, f"$.recipe.{name}", _kind(row["values"][name] for row in rows), "a swept field")
        for name in document["fields"]
        if name not in ("scene", "seed")
    ]
    said = Description(
        title=title,
        text=collection_summary(rows),
        identity=hash_bytes(identities.encode()),
        files=list_files(root, [COLLECTION]),
        file_sets={
            MANIFESTS: (f"*/{MANIFEST}", JSON),
            "index": (INDEX, JSON_LINES),
            "arrays": ("*/*.zarr/**", ZARR),
            "radiance": (f"*/{RADIANCE}/*.exr", EXR),
        },
        fields=[*FIELDS, *(field for field in swept if field.kind)],
    )
    return card_of_collection(title, document, rows, terms), said


def _has(manifest: Mapping[str, Any], path: str) -> bool:
    """Whether a manifest has a value in a place such as $.photons.total."""
    value: Any = manifest
    for name in path.removeprefix("$.").split("."):
        value = value.get(name) if isinstance(value, Mapping) else None
    return value is not None


def _kind(values: Iterable[Any]) -> str:
    """Croissant's type of these values; "" for lists and for values of several types."""
    kinds = {type(value) for value in values}
    if kinds == {int, float}:
        kinds = {float}
    return KINDS.get(kinds.pop(), "") if len(kinds) == 1 else ""


def stored_arrays(files: Iterable[str]) -> list[tuple[str, Label]]:
    """Path and label of each Zarr array among the files of a dataset, in their order."""
    found = []
    for name in files:
        group, _, rest = name.partition("/")
        labels = GROUPS.get(f"{group.removesuffix('.zarr').split('-')[0]}.zarr", {})
        array = rest.removesuffix("/zarr.json")
        if array != rest and array in labels:
            found.append((f"{group}/{array}", labels[array]))
    return found

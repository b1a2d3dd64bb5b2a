"""Datasets and collections as JSON-LD in the Croissant format 1.0 of MLCommons.

http://mlcommons.org/croissant/1.0: a `FileObject` with its SHA-256 for each file of data, `FileSet`s, and
`RecordSet`s. Manifests and the index of a collection, which hold times, are in file sets: each ends in a
checksum of its own. So the document has the same bytes whenever and wherever the same data are made.
"""

import mimetypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pcii.core.array_labels import Label
from pcii.exporting.publication_terms import Terms

CONFORMS_TO = "http://mlcommons.org/croissant/1.0"
CONTEXT: dict[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "dct": "http://purl.org/dc/terms/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    **{
        name: f"cr:{name}"
        for name in (
            *("citeAs", "column", "equivalentProperty", "extract", "field", "fileProperty", "fileObject"),
            *("fileSet", "format", "includes", "isLiveDataset", "jsonPath", "key", "md5", "parentField"),
            *("path", "recordSet", "references", "regex", "repeated", "replace", "samplingRate"),
            *("separator", "source", "subField", "transform"),
        )
    },
}
"""The names of the format, as its specification maps them."""
MIME = {".exr": "image/x-exr", ".md": "text/markdown", ".jsonl": "application/jsonl"}
MANIFESTS, DATASETS, ARRAYS = "manifests", "datasets", "arrays"


@dataclass(frozen=True)
class ManifestField:
    """A field of the records of datasets: its name, its place in manifests (JSONPath), type, meaning."""

    name: str
    path: str
    kind: str
    meaning: str


@dataclass(frozen=True)
class Description:
    """What a document says: of the whole, of its own files, and of sets of files by their globs.

    The set `manifests` is that of the manifests, from each of which `fields` make a record. `arrays` are all
    Zarr arrays.
    """

    title: str
    text: str
    identity: str
    files: Mapping[str, Mapping[str, Any]]
    file_sets: Mapping[str, tuple[str, str]]
    """Glob and MIME type by name."""
    fields: Sequence[ManifestField]
    arrays: Sequence[tuple[str, Label]] = ()


def croissant(said: Description, terms: Terms) -> dict[str, Any]:
    """The document."""
    document = {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": CONFORMS_TO,
        "name": said.title,
        "description": said.text,
        "identifier": said.identity,
        "version": "1.0.0",
        "license": terms.licence_url,
        "creator": [{"@type": "sc:Organization", "name": name} for name in terms.creators],
        "citeAs": terms.citation,
        "distribution": [
            *(_file_object(name, entry) for name, entry in said.files.items()),
            *(_file_set(name, *glob_and_kind) for name, glob_and_kind in said.file_sets.items()),
        ],
        "recordSet": [_datasets(said.fields), *([_arrays(said.arrays)] if said.arrays else [])],
    }
    return document | ({"url": terms.url} if terms.url else {})


def _file_set(name: str, glob: str, kind: str) -> dict[str, Any]:
    return {"@type": "cr:FileSet", "@id": name, "name": name, "encodingFormat": kind, "includes": glob}


def _file_object(name: str, entry: Mapping[str, Any]) -> dict[str, Any]:
    suffix = name[name.rfind(".") :] if "." in name.rsplit("/", 1)[-1] else ""
    kind = MIME.get(suffix) or mimetypes.types_map.get(suffix, "application/octet-stream")
    return {
        "@type": "cr:FileObject",
        "@id": name,
        "name": name,
        "contentUrl": name,
        "contentSize": f"{entry['bytes']} B",
        "encodingFormat": kind,
        "sha256": entry["sha256"],
    }


def _datasets(fields: Sequence[ManifestField]) -> dict[str, Any]:
    """A record for each manifest."""
    described = []
    for field in fields:
        source = {"fileSet": {"@id": MANIFESTS}, "extract": {"jsonPath": field.path}}
        described.append(_field(DATASETS, field.name, field.kind, field.meaning) | {"source": source})
    return {
        "@type": "cr:RecordSet",
        "@id": DATASETS,
        "name": DATASETS,
        "description": "A record for each dataset, from its manifest.",
        "field": described,
    }


def _arrays(arrays: Sequence[tuple[str, Label]]) -> dict[str, Any]:
    """A table of the Zarr arrays: where they are, their axes, units and meanings."""
    columns = {"path": "Zarr array", "axes": "names of its axes", "unit": "its unit", "meaning": "what it is"}
    rows = [(path, " ".join(label.dims), label.unit, label.meaning) for path, label in arrays]
    return {
        "@type": "cr:RecordSet",
        "@id": ARRAYS,
        "name": ARRAYS,
        "description": "The Zarr v3 arrays of the dataset.",
        "key": {"@id": f"{ARRAYS}/path"},
        "field": [_field(ARRAYS, name, "sc:Text", meaning) for name, meaning in columns.items()],
        "data": [{f"{ARRAYS}/{name}": cell for name, cell in zip(columns, row, strict=True)} for row in rows],
    }


def _field(records: str, name: str, kind: str, meaning: str) -> dict[str, Any]:
    return {
        "@type": "cr:Field",
        "@id": f"{records}/{name}",
        "name": name,
        "description": meaning,
        "dataType": kind,
    }

"""Croissant metadata of a collection (mlcommons.org/croissant, 1.0), which catalogues of datasets read.

Files are named by their places in the folder of the collection. Records are the datasets, as their manifests
describe them; their arrays are Zarr, which Croissant has no way to read.
"""

from pathlib import Path
from typing import Any

from pcii.base import write_json_safely
from pcii.store import CROISSANT, INDEX, MANIFEST, RADIANCE, Terms, hash_file

TERMS = "citeAs", "extract", "field", "fileSet", "includes", "jsonPath", "recordSet", "source"
CONTEXT: dict[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "dct": "http://purl.org/dc/terms/",
    "conformsTo": "dct:conformsTo",
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    **{term: f"cr:{term}" for term in TERMS},
}
"""Of the context that the format prescribes what is used here."""
FIELDS = {
    "title": ("sc:Text", "$.title"),
    "scene": ("sc:Text", "$.recipe.scene"),
    "seed": ("sc:Integer", "$.recipe.seed"),
    "identity": ("sc:Text", "$.identity"),
}
"""Of a record: type, and where a manifest has it."""


def write_croissant(root: Path, name: str, description: str, terms: Terms) -> None:
    """Write `croissant.json` of a finished collection. What the terms leave open is left out."""
    file_sets = {
        "manifests": (f"*/{MANIFEST}", "application/json"),
        "arrays": ("*/*.zarr/**", "application/vnd.zarr"),
        "radiance": (f"*/{RADIANCE}/*.exr", "image/x-exr"),
    }
    index = {
        "contentUrl": INDEX,
        "encodingFormat": "application/jsonlines",
        "sha256": hash_file(root / INDEX),
    }
    stated = {
        "license": terms.licence and terms.address,
        "url": terms.url,
        "citeAs": terms.citation,
        "creator": [{"@type": "sc:Organization", "name": creator} for creator in terms.creators],
    }
    fields = [
        _node("cr:Field", f"datasets/{field}", dataType=kind, source=_of_manifest(place))
        for field, (kind, place) in FIELDS.items()
    ]
    write_json_safely(
        root / CROISSANT,
        {
            "@context": CONTEXT,
            "@type": "sc:Dataset",
            "conformsTo": "http://mlcommons.org/croissant/1.0",
            "name": name,
            "description": description,
            **{key: value for key, value in stated.items() if value},
            "distribution": [
                _node("cr:FileObject", "index", **index),
                *(
                    _node("cr:FileSet", key, includes=pattern, encodingFormat=kind)
                    for key, (pattern, kind) in file_sets.items()
                ),
            ],
            "recordSet": [_node("cr:RecordSet", "datasets", field=fields)],
        },
    )


def _node(kind: str, name: str, **members: Any) -> dict[str, Any]:
    return {"@type": kind, "@id": name, "name": name, **members}


def _of_manifest(place: str) -> dict[str, Any]:
    return {"fileSet": {"@id": "manifests"}, "extract": {"jsonPath": place}}

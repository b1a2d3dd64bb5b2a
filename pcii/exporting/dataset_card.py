"""The card of a dataset or collection: README.md for people, in Markdown."""

from collections.abc import Mapping, Sequence
from typing import Any

from pcii.base.plain_text import in_json, in_markdown, web_address
from pcii.core.array_labels import Label
from pcii.exporting.publication_terms import PROJECT, Terms

TAGS = ("integral-imaging", "photon-counting", "light-field", "depth-estimation", "simulation")
HOW_TO_READ = """## How to read it

```python
import pcii  # pip install photon-integral-imaging

{example}
```

xarray opens each array group: `xarray.open_zarr("{group}/truth.zarr", consolidated=False)`.
`simgen export` writes PNG, OpenEXR, NumPy archives and the layout of the HCI 4D light field benchmark, and
`simgen verify` compares every file with its hash. X points right, Y down, Z forward, in millimetres; `z` is
planar depth. `croissant.json` describes the same for machines (MLCommons Croissant 1.0).
"""
READ_DATASET = """dataset = pcii.open_dataset("FOLDER")
dataset.counts, dataset.truth, dataset.views, dataset.grid"""
READ_COLLECTION = """collection = pcii.open_collection("FOLDER")
for dataset in collection:
    dataset.counts, dataset.truth, dataset.views, dataset.grid"""


def dataset_summary(manifest: Mapping[str, Any]) -> str:
    """What a dataset is, in two sentences of plain text."""
    grid, recipe = manifest["grid"], manifest.get("recipe", {})
    pattern = f"Bayer pattern {manifest['cfa']}" if manifest["cfa"] else "no colour filters"
    photons = (manifest.get("photons") or {}).get("total")
    caught = "" if photons is None else f" {photons} photons were counted in all."
    scene = f" of the scene {recipe['scene']}" if recipe.get("scene") else ""
    return (
        f"Integral imaging in little light: {grid['rows']} x {grid['cols']} views of {grid['height']} x "
        f"{grid['width']} pixels{scene}, {pattern}.{caught}"
    )


def card_of_dataset(
    title: str, manifest: Mapping[str, Any], arrays: Sequence[tuple[str, Label]], terms: Terms
) -> str:
    """README.md of a single dataset."""
    objects = ", ".join(in_markdown(str(name)) for name in manifest.get("objects", {}).values())
    rows = [
        f"| `{path}` | {', '.join(label.dims)} | {label.unit} | {label.meaning} |" for path, label in arrays
    ]
    held = ["| Array | Axes | Unit | What it is |", "|---|---|---|---|", *rows] if rows else []
    radiance = manifest.get("radiance_channels")
    if radiance:
        unit = in_markdown(str(manifest.get("radiance_unit", "")))
        colours = "one colour a pixel" if radiance == 1 else "R, G, B"
        held += ["", f"`radiance/` has each view as float32 EXR ({colours}): {unit}."]
    parts = [
        *_head(title, dataset_summary(manifest), terms),
        "## What is in it",
        "\n".join(held),
        f"Objects: {objects}." if objects else "",
        *_how_made(manifest.get("recipe", {}), manifest),
        HOW_TO_READ.format(example=READ_DATASET, group="FOLDER").strip(),
        *_terms(terms),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def card_of_collection(
    title: str, document: Mapping[str, Any], rows: Sequence[Mapping[str, Any]], terms: Terms
) -> str:
    """README.md of a collection with these rows in its index."""
    fields = list(document["fields"])
    values = {field: list(dict.fromkeys(in_json(row["values"][field]) for row in rows)) for field in fields}
    swept = [f"| `{field}` | {len(values[field])} | {_few(values[field])} |" for field in fields]
    splits = {name: sum(row.get("split") == name for row in rows) for name in ("train", "validation", "test")}
    said = ", ".join(f"{count} {name}" for name, count in splits.items() if count)
    parts = [
        *_head(title, collection_summary(rows), terms),
        "## What is in it",
        "A folder for each dataset, `collection.json` (the recipe that all have in common) and `index.jsonl` "
        "(a line for each dataset). What differs between them:",
        "\n".join(["| Field of the recipe | Values | Which |", "|---|---|---|", *swept]),
        f"Split by the number of the scene: {said}." if said else "",
        *_how_made(document.get("recipe", {}), {"versions": document.get("software", {})}),
        HOW_TO_READ.format(example=READ_COLLECTION, group="FOLDER/DATASET").strip(),
        *_terms(terms),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def collection_summary(rows: Sequence[Mapping[str, Any]]) -> str:
    """What a collection is, in a sentence."""
    return f"A collection of {len(rows)} datasets of integral imaging in little light, made by simulation."


def _few(values: Sequence[str]) -> str:
    shown = values if len(values) <= 6 else [*values[:3], "...", values[-1]]
    return ", ".join(in_markdown(value) for value in shown)


def _head(title: str, sentence: str, terms: Terms) -> list[str]:
    licence = ["license: other", f"license_link: {in_json(terms.licence)}"]
    if "://" not in terms.licence:
        licence = [f"license: {in_json(terms.licence.lower())}"]
    front = ["---", *licence, f"pretty_name: {in_json(title)}", f"tags: {in_json(TAGS)}", "---"]
    return ["\n".join(front), f"# {in_markdown(title)}", in_markdown(sentence)]


def _how_made(recipe: Mapping[str, Any], manifest: Mapping[str, Any]) -> list[str]:
    """The recipe, the command and the software; nothing for a dataset without a recipe."""
    import tomli_w

    if not recipe.get("scene"):
        return []
    versions = dict(manifest.get("versions", {})) | {
        name: version
        for name, version in (manifest.get("backend") or {}).items()
        if name in ("mitsuba", "drjit")
    }
    software = ", ".join(f"{in_markdown(str(name))} {in_markdown(str(n))}" for name, n in versions.items())
    return [
        "## How it was made",
        f"With this recipe, by `simgen generate recipe.toml -o FOLDER` of {PROJECT}"
        + (f" ({software})." if software else "."),
        f"````toml\n{tomli_w.dumps(_without_none(recipe)).strip()}\n````",
    ]


def _without_none(value: Any) -> Any:
    """The value without members that are None, which TOML has no word for."""
    if isinstance(value, Mapping):
        return {name: _without_none(member) for name, member in value.items() if member is not None}
    return [_without_none(member) for member in value] if isinstance(value, list) else value


def _terms(terms: Terms) -> list[str]:
    licence, link = in_markdown(terms.licence), web_address(terms.licence_url)
    address = web_address(terms.url)
    where = [f"Where: {f'<{address}>' if address else in_markdown(terms.url)}"] if terms.url else []
    return [
        "## Licence and citation",
        f"Licence: {f'[{licence}](<{link}>)' if link else licence}. "
        f"By {', '.join(in_markdown(name) for name in terms.creators)}. Please cite:",
        f"> {in_markdown(terms.citation)}",
        *where,
    ]

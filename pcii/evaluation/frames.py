"""The frame of an evaluation: its rows as a data frame of pandas.

It has a row for each dataset, light, method and plane, or depth map. Its columns, which docs/evaluation.md
lists, are `HEAD`, `photons_per_view`, `seconds`, and what was measured: `iou` and the other scores against
the objects of the plane, `pixel_iou` and the others against the points within 1 px of blur, `within_1px` and
the other scores of depth, with dots for what is nested, `bound_px`.
"""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pcii.base.errors import InputError
from pcii.evaluation.rows import HEAD, Row, leaves, plane_parts, read_rows
from pcii.store.folders import ROWS

if TYPE_CHECKING:
    from pandas import DataFrame

MAX_COLUMNS = 300
"""Some three times what the measures need; a page takes 10 ms for each."""


def read_frame(out: str | Path) -> "DataFrame":
    """The frame of the evaluation in a folder; raises `InputError` as `read_rows` does."""
    return frame_of(read_rows(Path(out)))


def frame_of(rows: Sequence[Row]) -> "DataFrame":
    """The frame of rows, scenes in their order; raises `InputError` for more than `MAX_COLUMNS` measures."""
    import pandas as pd

    labels = _labels(rows)
    records = [
        {
            "scene": labels[row["title"], row["recipe"]],
            "light": "by exposure" if row["budget"] is None else row["budget"],
        }
        | {name: row.get(name) for name in ("method", "dataset", "seed", "identity", "recipe")}
        | {"z_mm": None, "objects": None}
        | {name: row.get(name) for name in ("photons_per_view", "seconds")}
        | measured
        for row in rows
        for measured in ([_of_depth(row)] if "depth" in row else _of_planes(row))
    ]
    if len(set().union(*records)) > MAX_COLUMNS:
        raise InputError(
            f"{ROWS}: expected the same measures in all rows, not more than {MAX_COLUMNS} different ones"
        )
    frame = pd.DataFrame(records, columns=None if records else [*HEAD])
    texts = ["scene", "method", "dataset", "identity", "recipe", "objects"]
    frame[texts] = frame[texts].map(_encodable, na_action="ignore")
    numbers = frame.columns.difference([*texts, "light"])
    frame[numbers] = frame[numbers].astype("float64")
    frame["scene"] = pd.Categorical(frame["scene"], list(dict.fromkeys(frame["scene"])))
    # Numbers of photons, then an exposure, then full light.
    lights = sorted(set(frame["light"]), key=lambda light: (isinstance(light, str), light))
    frame["light"] = pd.Categorical(frame["light"], lights, ordered=True)
    return frame


def _encodable(text: str) -> str:
    """The text with escapes for parts of names of files that are no characters, which pandas cannot hold."""
    return text.encode(errors="backslashreplace").decode()


def _of_depth(row: Row) -> Row:
    return dict(leaves(row["depth"])) | ({"bound_px": row["bound_px"]} if "bound_px" in row else {})


def _of_planes(row: Row) -> Iterable[Row]:
    """A record for each plane, with its scores against both kinds of truth."""
    records: dict[float, Row] = {}
    for plane in row["planes"]:
        record = records.setdefault(plane["z_mm"], {"z_mm": plane["z_mm"], "objects": None})
        scores = dict(leaves(plane_parts(plane)["scores"]))
        if plane["truth"] == "object":
            record |= {"objects": plane["object"]} | scores
        else:
            record |= {f"pixel_{name}": scores[name] for name in scores}
    return records.values()


def _labels(rows: Sequence[Row]) -> dict[tuple[str, str], str]:
    """By title and recipe: the title, with the settings that distinguish it from others of the same title."""
    recipes: dict[str, dict[str, dict[str, str]]] = {}
    for row in rows:
        settings = row.get("settings", {})
        texts = {name: text if isinstance(text, str) else json.dumps(text) for name, text in settings.items()}
        recipes.setdefault(row["title"], {}).setdefault(row["recipe"], texts)
    labels: dict[tuple[str, str], str] = {}
    for title, by_recipe in recipes.items():
        names = dict.fromkeys(name for settings in by_recipe.values() for name in settings)
        differing = [name for name in names if len({texts.get(name) for texts in by_recipe.values()}) > 1]
        parts = {
            recipe: [f"{name}={texts[name]}" for name in differing if name in texts]
            for recipe, texts in by_recipe.items()
        }
        for recipe, words in parts.items():
            if len(parts) > 1 and list(parts.values()).count(words) > 1:
                # A scene that was changed, or has no recipe, differs in no setting.
                words = [*words, f"recipe {recipe[:8]}"]
            labels[title, recipe] = f"{title} ({', '.join(words)})" if words else title
    return labels

"""Files of an evaluation: evaluation.json, a self-contained HTML page, and Markdown."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pcii.base.plain_text import in_markdown
from pcii.base.safe_files import sweep_temporaries, write_bytes_safely
from pcii.evaluation.pages import page
from pcii.evaluation.pooling import pooled_tables
from pcii.evaluation.tables import (
    Table,
    light_name,
    markdown,
    overviews,
    tables_of,
    with_interval,
)
from pcii.figures.charts import accuracy_chart, calibration_chart
from pcii.figures.panels import figure_uri
from pcii.store.folders import ROWS, hash_file, seal_evaluation

MEASURES = {
    "iou": ("object", "IoU, mean over planes"),
    "bad_1px": ("depth", "share of errors of depth above 1 px"),
    "median_px": ("depth", "median error of depth, px of total disparity"),
}
"""What accuracy is drawn by: the part of the results that has it, and the label of its axis."""


def write_evaluation(out: Path, evaluation: Mapping[str, Any], others: Sequence[str] = ()) -> None:
    """Write the result of `summarise` as evaluation.md and evaluation.html, and last as evaluation.json.

    That lists the files `others` too. The caller keeps others from adding rows meanwhile.
    """
    sweep_temporaries(out)
    made = _made(evaluation, hash_file(out / ROWS))
    pages = {
        "evaluation.md": _markdown(evaluation, made).encode(),
        "evaluation.html": _page(evaluation, made),
    }
    for name, content in pages.items():
        write_bytes_safely(out / name, content)
    seal_evaluation(out, evaluation, [*pages, *others])


def _methods(evaluation: Mapping[str, Any], part: str) -> list[str]:
    """Methods whose results have this part."""
    rows = [row for group in evaluation["groups"] for row in group["results"] if part in row]
    return sorted({row["method"] for row in rows})


def _notes(evaluation: Mapping[str, Any]) -> list[str]:
    """Sentences that explain the tables."""
    notes = [
        "Scores compare masks with the objects that belong to each plane, and are means over the planes "
        f"unless a plane is named. In brackets: {evaluation['interval']}.",
        "In bold: the best mean at the same photons, and of the same scene. Others may be as good: see the "
        "interval of the difference.",
        "p: two-sided sign-flip permutation test on the same datasets, without correction for multiple "
        "comparisons. Of n pairs it cannot be less than 2 / 2^n, so fewer than six never give 0.05.",
    ]
    if evaluation["pooled"]:
        notes.append(
            "Over all scenes: every scene counts once, as the mean over its seeds, and all methods are "
            "compared on the same scenes and seeds. Intervals and p are of the spread between scenes."
        )
    if evaluation["made"]["differing"]:
        notes.append(
            f"Not all rows are of the same software ({', '.join(evaluation['made']['differing'])}): name all "
            "datasets and methods again to measure older rows anew."
        )
    if _methods(evaluation, "depth"):
        notes.append(
            "Depth: errors are in px of total disparity, over the objects' pixels, and less is better; a "
            "missing answer is an error above 1 px. ECE: how far confidence and the share of depths within "
            "1 px are apart on average, over all answered pixels."
        )
    return notes


def _losses(group: Mapping[str, Any]) -> list[str]:
    """A sentence for each method that is worse with more light."""
    sentences: list[str] = []
    for loss in group["monotonic"]:
        name, change = ("IoU", "lower") if loss["measure"] == "iou" else ("bad_1px", "higher")
        fewer = light_name(loss["from"]).removesuffix(" photons")
        sentences.append(
            f"{name} of {loss['method']} is {change} with {light_name(loss['to'])} than with {fewer}, by "
            f"{with_interval(loss['difference'])}."
        )
    return sentences


def _markdown(evaluation: Mapping[str, Any], made: Table) -> str:
    blocks = ["# Evaluation", *_notes(evaluation)]
    for table in (*pooled_tables(evaluation), *overviews(evaluation["groups"])):
        blocks += [f"## {table.title}", markdown(table)]
    for group in evaluation["groups"]:
        blocks.append(f"## {in_markdown(group['label'])}")
        blocks += [f"### {table.title}\n\n{markdown(table)}" for table in tables_of(group)]
        blocks += map(in_markdown, _losses(group))
    blocks += [f"## {made.title}", markdown(made)]
    return "\n\n".join(blocks) + "\n"


def _page(evaluation: Mapping[str, Any], made: Table) -> bytes:
    removal, depth = (_methods(evaluation, part) for part in ("object", "depth"))
    groups = [
        {
            "label": group["label"],
            "datasets": group["datasets"],
            "recipe": group["recipe"],
            "plots": _plots(group, removal, depth),
            "tables": tables_of(group),
            "losses": _losses(group),
        }
        for group in evaluation["groups"]
    ]
    content = {
        "made": made,
        "notes": _notes(evaluation),
        "overviews": [*pooled_tables(evaluation), *overviews(evaluation["groups"])],
        "groups": groups,
    }
    return page("evaluation.html.j2", content)


def _plots(group: Mapping[str, Any], removal: Sequence[str], depth: Sequence[str]) -> list[tuple[str, str]]:
    """Pictures of a group with what they show in words."""
    plots = [
        (accuracy_plots(group, removal), "IoU of each method against photons and seconds"),
        (
            accuracy_plots(group, depth, "bad_1px"),
            "Errors above 1 px of each method of depth against photons and seconds",
        ),
        (
            calibration_plots(group, depth),
            "Share of correct depths against confidence, by photons per view",
        ),
    ]
    return [(image, words) for image, words in plots if image]


def accuracy_plots(group: Mapping[str, Any], methods: Sequence[str], measure: str = "iou") -> str:
    """One of `MEASURES` against photons per view, and against seconds, as a PNG in a data URI.

    Empty if none of `methods` has the measure, or neither photons nor seconds are known.
    """
    import pandas as pd

    part, label = MEASURES[measure]
    rows = []
    for row in group["results"]:
        mean = row.get(part, {}).get(measure)
        if mean and row["method"] in methods:
            low, high = mean["interval"] or (mean["mean"], mean["mean"])
            seconds = None if row["seconds"] is None else row["seconds"]["mean"]
            rows.append((row["method"], row["photons_per_view"], seconds, mean["mean"], low, high))
    columns = ["method", "photons_per_view", "seconds", "mean", "low", "high"]
    figure = accuracy_chart(
        pd.DataFrame(rows, columns=columns), methods, label, is_share=measure != "median_px"
    )
    return "" if figure is None else figure_uri(figure)


def calibration_plots(group: Mapping[str, Any], methods: Sequence[str]) -> str:
    """Share of correct depths against their stated confidence, by light, as a PNG in a data URI.

    Empty if no method of `methods` answers anything.
    """
    import pandas as pd

    rows = [
        {"method": row["method"], "light": light_name(row["budget"])}
        | {name: one[name]["mean"] for name in ("confidence", "correct", "share")}
        for row in group["results"]
        if row["method"] in methods
        for one in (row["depth"].get("reliability") or {}).values()
        if one["confidence"] is not None
    ]
    return figure_uri(calibration_chart(pd.DataFrame(rows), methods)) if rows else ""


def _made(evaluation: Mapping[str, Any], rows_sha256: str) -> Table:
    """How to cite an evaluation, and what it was made by; `rows_sha256` is that of its rows.jsonl."""
    made = evaluation["made"]
    groups = evaluation["groups"]
    methods = len({row["method"] for group in groups for row in group["results"]})
    days = "" if made["days"] is None else f", measured {' to '.join(dict.fromkeys(made['days']))}"
    counted = (
        (sum(group["datasets"] for group in groups), "dataset"),
        (len(groups), "scene"),
        (methods, "method"),
    )
    datasets, scenes, of_methods = (f"{n} {word}{'' if n == 1 else 's'}" for n, word in counted)
    rows = [
        (
            "to cite",
            f"Evaluation of {of_methods} on {datasets} of {scenes} by photon-integral-imaging "
            f"{evaluation['version']}{days}; SHA-256 of rows.jsonl {rows_sha256}",
        ),
        ("machine", _counted(made["machines"])),
        *((name, _counted(numbers)) for name, numbers in made["software"].items()),
        ("datasets", f"SHA-256 of their identities {made['datasets']}"),
    ]
    if made["unknown"]:
        rows.append(("software not known", f"{made['unknown']} rows: of functions, or of an earlier release"))
    return Table("How this was made", ("what", "value"), tuple(row for row in rows if row[1]), words=2)


def _counted(rows_by_text: Mapping[str, int]) -> str:
    """Texts, with the number of rows of each where they are several."""
    if len(rows_by_text) == 1:
        return next(iter(rows_by_text))
    return "; ".join(f"{text} ({rows} rows)" for text, rows in rows_by_text.items())

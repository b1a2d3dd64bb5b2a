"""Files of an evaluation: evaluation.json, a self-contained HTML page, and Markdown."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pcii.base.plain_text import in_markdown
from pcii.base.safe_files import sweep_temporaries, write_bytes_safely
from pcii.evaluation.pages import page
from pcii.evaluation.plots import accuracy_plots, calibration_plots
from pcii.evaluation.tables import light_name, markdown, overviews, tables_of, with_interval
from pcii.io.evaluation_layout import seal_evaluation


def write_evaluation(out: Path, evaluation: Mapping[str, Any]) -> None:
    """Write the result of `summarise` as evaluation.md and evaluation.html, and last as evaluation.json.

    The caller keeps others from adding rows meanwhile.
    """
    sweep_temporaries(out)
    pages = {"evaluation.md": _markdown(evaluation).encode(), "evaluation.html": _page(evaluation)}
    for name, content in pages.items():
        write_bytes_safely(out / name, content)
    seal_evaluation(out, evaluation, list(pages))


def _methods(evaluation: Mapping[str, Any], part: str) -> list[str]:
    """Methods whose results have this part."""
    rows = [row for group in evaluation["groups"] for row in group["results"] if part in row]
    return sorted({row["method"] for row in rows})


def _notes(evaluation: Mapping[str, Any]) -> list[str]:
    """Sentences that explain the tables."""
    notes = [
        "Scores compare masks with the objects that belong to each plane, and are means over the planes "
        f"unless a plane is named. In brackets: {evaluation['interval']}.",
        "p: two-sided sign-flip permutation test on the same datasets, without correction for multiple "
        "comparisons.",
    ]
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


def _markdown(evaluation: Mapping[str, Any]) -> str:
    blocks = ["# Evaluation", *_notes(evaluation)]
    for table in overviews(evaluation["groups"]):
        blocks += [f"## {table.title}", markdown(table)]
    for group in evaluation["groups"]:
        blocks.append(f"## {in_markdown(group['label'])}")
        blocks += [f"### {table.title}\n\n{markdown(table)}" for table in tables_of(group)]
        blocks += map(in_markdown, _losses(group))
    return "\n\n".join(blocks) + "\n"


def _page(evaluation: Mapping[str, Any]) -> bytes:
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
        "version": evaluation["version"],
        "notes": _notes(evaluation),
        "overviews": overviews(evaluation["groups"]),
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

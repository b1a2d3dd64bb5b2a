"""Files of an evaluation: evaluation.json, a self-contained HTML page, and Markdown."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pcii.base.plain_text import in_markdown
from pcii.base.safe_files import sweep_temporaries, write_bytes_safely
from pcii.evaluation.pages import page
from pcii.evaluation.plots import accuracy_plots
from pcii.evaluation.tables import budget_name, markdown, overview, tables_of, with_interval
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


def _methods(evaluation: Mapping[str, Any]) -> list[str]:
    rows = [row for group in evaluation["groups"] for row in group["results"] if "object" in row]
    return sorted({row["method"] for row in rows})


def _notes(evaluation: Mapping[str, Any]) -> list[str]:
    """Sentences that explain the tables."""
    notes = [
        "Scores compare masks with the objects that belong to each plane, and are means over the planes "
        f"unless a plane is named. In brackets: {evaluation['interval']}.",
        "p: two-sided sign-flip permutation test on the same datasets, without correction for multiple "
        "comparisons.",
    ]
    return notes


def _falls(group: Mapping[str, Any]) -> list[str]:
    return [
        f"IoU of {fall['method']} is lower with {budget_name(fall['to'])} photons than with "
        f"{budget_name(fall['from'])}, by {with_interval(fall['difference'])}."
        for fall in group["monotonic"]
    ]


def _markdown(evaluation: Mapping[str, Any]) -> str:
    blocks = ["# Evaluation", *_notes(evaluation)]
    table = overview(evaluation["groups"])
    if table.rows:
        blocks += [f"## {table.title}", markdown(table)]
    for group in evaluation["groups"]:
        blocks.append(f"## {in_markdown(group['label'])}")
        blocks += [f"### {table.title}\n\n{markdown(table)}" for table in tables_of(group)]
        blocks += map(in_markdown, _falls(group))
    return "\n\n".join(blocks) + "\n"


def _page(evaluation: Mapping[str, Any]) -> bytes:
    methods = _methods(evaluation)
    groups = [
        {
            "label": group["label"],
            "datasets": group["datasets"],
            "recipe": group["recipe"],
            "plot": accuracy_plots(group, methods) if methods else "",
            "tables": tables_of(group),
            "falls": _falls(group),
        }
        for group in evaluation["groups"]
    ]
    content = {
        "version": evaluation["version"],
        "notes": _notes(evaluation),
        "overview": overview(evaluation["groups"]),
        "groups": groups,
    }
    return page("evaluation.html.j2", content)

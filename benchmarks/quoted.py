"""Figures that pages quote: docs/figures.json, and the marks between which they stand.

A page has `<!-- photons.paper_ms -->553 ms (537 to 566)<!-- -->`, of which readers see the text alone, and
publishing writes the text anew. A mark never begins a line: Markdown would take the line for HTML.
"""

import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.machine import commit, in_words
from benchmarks.page import value_text
from benchmarks.results import UNITS, Record, Value, value_of
from benchmarks.studies import photon_costs
from pcii.base import InputError, write_bytes_safely, write_json_safely
from pcii.evaluation import SUBMISSION, frame_of, means, means_over_scenes, read_rows
from pcii.evaluation.evaluation_page import lines_of
from pcii.evaluation.rows import by_scene, origin_of
from pcii.store import IN_FRAMES, own_software

if TYPE_CHECKING:
    from pandas import DataFrame

ROOT = Path(__file__).resolve().parent.parent
FILE = ROOT / "docs" / "figures.json"
MARK = re.compile(r"<!-- ([\w.-]+) -->(.*?)<!-- -->")
MEASURES = ("iou", "within_1px", "within_3px")
"""What is quoted of the public benchmark."""
Content = dict[str, dict[str, Any]]


def text_of(name: str, value: Value) -> str:
    """A figure as pages quote it; a part of its name ends in its unit, that of a ratio begins with against.

    >>> text_of("photons.paper_ms", Value(553.2, 537, 566)), text_of("photons.against_dense", Value(52.8))
    ('553 ms (537 to 566)', '52.8 ×')
    """
    parts = name.split(".")
    ends = [part.rpartition("_")[2] for part in parts if "_" in part]
    unit = "×" if parts[-1].startswith("against_") else "".join(UNITS.get(end, "") for end in ends)
    number, _, interval = value_text(value).partition(" ")
    return " ".join(part for part in (number, unit, interval) if part)


def read_figures() -> Content:
    """What docs/figures.json has: `figures` by name, and where they come from, `sources` by name."""
    return json.loads(FILE.read_text(encoding="utf-8"))


def add(content: Content, source: str, about: Mapping[str, str], values: Iterable[tuple[str, Value]]) -> None:
    """Put the figures of a source in the place of those that it had."""
    kept = {name: each for name, each in content["figures"].items() if each["source"] != source}
    new = {name: {"text": text_of(name, value), **asdict(value), "source": source} for name, value in values}
    content["sources"][source] = dict(about)
    content["figures"] = dict(sorted((kept | new).items()))


def add_study(content: Content, record: Record) -> None:
    """What is quoted of the study of the cost of photons, at quick size: others have other rows."""
    if record.study == photon_costs.STUDY.name and record.size == "quick":
        about = {
            "command": f"python -m benchmarks {record.study}",
            "machine": in_words(record.machine),
            "date": record.date[:10],
            "commit": record.versions["commit"],
        }
        paper = record.measured.one(photon_costs.PAPER, photon_costs.BASE)
        values = {
            "photons.paper_ms": paper.values["time_ms"],
            "photons.against_16_samples": record.measured.ratios[photon_costs.AGAINST_16],
        }
        add(content, record.study, about, values.items())


def add_benchmark(content: Content, submissions: Path) -> None:
    """Means over the scenes of the public benchmark, of the submissions in a folder, if there are any."""
    rows = [row for file in sorted(submissions.glob(f"*/{SUBMISSION}")) for row in read_rows(file.parent)]
    if rows:
        origin = origin_of(rows)
        is_of_this_source = all(own_software().items() <= row["software"].items() for row in rows)
        about = {
            "command": "pcii benchmark run METHOD --data out/pcii-bench-1 -o out/submissions/METHOD",
            "machine": ", ".join(origin["machines"]),
            "date": origin["days"][-1],
            "commit": commit() if is_of_this_source else "unknown",
        }
        of_scenes = means(frame_of(by_scene(rows)))
        of_scenes = of_scenes[~of_scenes["scene"].astype(str).str.endswith(IN_FRAMES)]
        add(content, "benchmark", about, named_means("benchmark", means_over_scenes(of_scenes, {}), MEASURES))


def named_means(source: str, table: "DataFrame", measures: Collection[str]) -> Iterator[tuple[str, Value]]:
    """Means of some measures by name: source.measure.method.photons."""
    for mean in lines_of(table):
        if mean.measure in measures:
            light = mean.light if isinstance(mean.light, str) else f"{mean.light:g}"
            yield f"{source}.{mean.measure}.{mean.method.removeprefix('depth:')}.{light}", value_of(mean)


def rewritten(page: str, text: str, figures: Mapping[str, Any]) -> str:
    """The text of a page with the figures as they are now; `InputError` for a mark of no figure."""
    for name, _ in MARK.findall(text):
        if name not in figures:
            raise InputError(f"{page}: quotes {name!r}, which {FILE.name} does not have")
    return MARK.sub(lambda mark: f"<!-- {mark[1]} -->{figures[mark[1]]['text']}<!-- -->", text)


def pages() -> list[Path]:
    """README and the pages of the guide."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def write_figures(content: Content) -> None:
    """Write docs/figures.json, and its figures into the pages, all of which are checked first."""
    texts = {
        page: rewritten(page.name, page.read_text(encoding="utf-8"), content["figures"]) for page in pages()
    }
    write_json_safely(FILE, content)
    for page, text in texts.items():
        write_bytes_safely(page, text.encode())

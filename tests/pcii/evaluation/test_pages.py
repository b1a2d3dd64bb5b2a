"""Names of strangers in pages and tables: shown as text, never carried out."""

import base64
import hashlib
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from hostile_names import DO, NAMES
from stored_datasets import rewrite_manifest
from tiny_datasets import NESTED, OWN, two_rows, write_dataset

import pcii.figures
from pcii.app import analyse, write_report
from pcii.base import visible
from pcii.evaluation import frame_of, write_evaluation
from pcii.removal import METHODS
from pcii.store import depth_range_of, open_dataset, planes_of
from pcii.types import Segmented

FOLDER = f'<img src=x onerror={DO}> "\u202e.d'
SHOWN = NAMES[:6]  # of so many scenes all tables are shown
ELEMENTS = "html head meta title style body main h1 h2 h3 p code span div table thead tbody tr th td strong "
ELEMENTS += "figure img figcaption details summary"
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
SCRIPT = (Path(pcii.figures.__file__).parent / "templates" / "report.js").read_bytes()
SCRIPT_HASH = base64.b64encode(hashlib.sha256(SCRIPT).digest()).decode()
# The report runs its own script, which its policy names by hash, and has controls and lists of numbers.
ALLOWED = {
    "report.html": (
        f"{ELEMENTS} script section label input output i pre",
        POLICY.replace("img-src", f"script-src 'sha256-{SCRIPT_HASH}'; img-src"),
    ),
    "evaluation.html": (ELEMENTS, POLICY),
}


class Read(HTMLParser):
    """Elements with their attributes, and the text between tags, of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def named(name: str) -> Any:
    """`two_rows` under another name."""

    def method(counts: Any, sections: Any) -> Segmented:
        return Segmented(two_rows(counts, sections).in_focus, name, sections)

    return method


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """A report and an evaluation of objects, titles, folders, groups and methods of such names."""
    root = write_dataset(tmp_path_factory.mktemp("data") / FOLDER, 1, {OWN: 5}, title=NAMES[0])
    rewrite_manifest(root, objects={str(number): name for number, name in enumerate(NAMES, start=1)})
    dataset, out = open_dataset(root), tmp_path_factory.mktemp("pages")
    with pytest.MonkeyPatch.context() as patch:
        for name in NAMES:
            patch.setitem(METHODS, name, named(name))
        outcome = analyse(dataset, planes_of(dataset, None), depth_range_of(dataset), NAMES)
    write_report(out / "report.html", outcome)
    (out / "rows.jsonl").touch()
    rows = [row for name in SHOWN for row in rows_of(name)]
    write_evaluation(out, frame_of(rows), {"software": {}, "differing": [], "machines": {}, "days": []})
    return {name: (out / name).read_bytes().decode() for name in ALLOWED}


def rows_of(name: str) -> list[dict[str, Any]]:
    """Two groups that share this title; more photons are worse."""
    head = {"dataset": name, "title": name, "photons_per_view": 1.0, "seconds": 1.0}
    reliability = {"0.9-1.0": {"share": 1.0, "confidence": 1.0, "correct": 0.5}}
    depth = {"depth": {"within_1px": 0.5, "ece": 0.5, "reliability": reliability}}
    removal = [
        head
        | {"recipe": f"{scene}{name}", "scene": scene, "settings": {"scene": scene, "x": 1}}
        | {"identity": f"{scene}{seed}{name}", "seed": seed, "budget": budget, "method": method}
        | {"planes": [{"z_mm": 1.0, "object": name, "truth": "object", "iou": iou}]}
        for scene in (name, "other")
        for seed in (1, 2)
        for method in (name, "three-step")
        for budget, iou in ((NESTED, 0.9), (OWN, 0.5))
    ]
    shown = [{key: row[key] for key in row if key != "planes"} for row in removal if row["method"] == name]
    return removal + [row | {"method": "depth:sweep-17"} | depth for row in shown]


@pytest.mark.parametrize("which", ALLOWED)
def test_a_page_has_nothing_but_its_own_elements(pages: dict[str, str], which: str) -> None:
    read, (elements, policy) = Read(pages[which]), ALLOWED[which]
    assert {"img"} < {tag for tag, _ in read.elements} <= {*elements.split()}
    for tag, attributes in read.elements:
        assert not any(re.match("on|href|srcdoc|action", name) for name in attributes), tag
        if "src" in attributes:
            assert tag == "img"
            assert re.match(r"data:image/(png|webp);base64,[A-Za-z0-9+/]+=*$", str(attributes["src"]))
    sent = [attributes for tag, attributes in read.elements if tag == "meta" and "http-equiv" in attributes]
    assert sent == [{"http-equiv": "Content-Security-Policy", "content": policy}]
    assert pages[which].index("Content-Security-Policy") < pages[which].index("<title>")
    scripts = re.findall(r"<script[^>]*>(.*?)</script>", pages[which], re.DOTALL | re.IGNORECASE)
    assert scripts == [SCRIPT.decode()] * (which == "report.html")


def test_all_names_show_as_text(pages: dict[str, str]) -> None:
    texts = Read(pages["report.html"]).texts
    assert texts.count(visible(NAMES[0])) > 4  # title, heading, object and method
    assert {*map(visible, NAMES)} <= {*texts}  # its object's row, and its method's rows
    assert any(text.startswith(visible(FOLDER)) for text in texts)
    texts = Read(pages["evaluation.html"]).texts
    for shown in map(visible, SHOWN):
        assert shown in texts  # the method
        for scene in (shown, "other"):
            assert f"{shown} (scene={scene})" in texts

"""Names of strangers in pages and tables: shown as text, never carried out."""

import base64
import hashlib
import html
import re
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from chromium import CHROMIUM
from hostile_names import DO, NAMES, RAN
from jinja2 import UndefinedError
from stored_datasets import rewrite_manifest
from tiny_datasets import NESTED, OWN, two_rows, write_dataset

from pcii.app.pipeline import Outcome, analyse
from pcii.app.report import write_report
from pcii.base.plain_text import in_markdown, visible
from pcii.evaluation import pages as pages_module
from pcii.evaluation.comparison import evaluate
from pcii.evaluation.pages import MAX_DETAILED_SCENES, page, write_evaluation
from pcii.evaluation.provenance import origin_of
from pcii.evaluation.rows import frame_of
from pcii.removal.methods import METHODS
from pcii.store.dataset import FULL_LIGHT, open_dataset
from pcii.store.suggested_depths import depth_range_of, planes_of
from pcii.types.estimates import Segmented

FOLDER = f'<img src=x onerror={DO}> "\u202e.d'
ELEMENTS = {"html", "head", "meta", "title", "style", "body", "main", "h1", "h2", "h3", "p", "code", "span"}
ELEMENTS |= {"div", "table", "tr", "th", "td", "strong", "figure", "img", "figcaption"}
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
SCRIPT = (Path(pages_module.__file__).parent / "templates" / "report.js").read_bytes()
SCRIPT_HASH = base64.b64encode(hashlib.sha256(SCRIPT).digest()).decode()
# The report runs its own script, which its policy names by hash, and has controls and lists of numbers.
OWN_ELEMENTS = {
    "report.html": {"script", "section", "label", "input", "output", "i"} | {"details", "summary", "pre"}
}
POLICIES = {
    "report.html": POLICY.replace("img-src", f"script-src 'sha256-{SCRIPT_HASH}'; img-src"),
    "evaluation.html": POLICY,
}


PICTURE = "data:image/png;base64,iVBORw0KGgo="


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
        found = two_rows(counts, sections)
        return Segmented(found.in_focus, name, found.sections)

    return method


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """Results of a dataset whose objects, title and folder have such names, by such methods."""
    root = write_dataset(tmp_path_factory.mktemp("data") / FOLDER, 1, {OWN: 5}, title=NAMES[0])
    rewrite_manifest(root, objects={str(number): name for number, name in enumerate(NAMES, start=1)})
    dataset = open_dataset(root)
    with pytest.MonkeyPatch.context() as patch:
        for name in NAMES:
            patch.setitem(METHODS, name, named(name))
        return analyse(dataset, planes_of(dataset, None), depth_range_of(dataset), NAMES)


@pytest.fixture(scope="module")
def pages(outcome: Outcome, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The report, and the evaluation of groups, objects, methods and datasets of such names."""
    out = tmp_path_factory.mktemp("pages")
    write_report(out / "report.html", outcome)
    rows = [row for name in NAMES for row in rows_of(name)]
    (out / "rows.jsonl").touch()
    with pytest.MonkeyPatch.context() as patch:
        # A plot takes half a second.
        patch.setattr(pages_module, "accuracy_plot", lambda *_: PICTURE)
        patch.setattr(pages_module, "_calibration_plot", lambda *_: PICTURE)
        patch.setattr(pages_module, "MAX_DETAILED_SCENES", 2 * len(NAMES))
        write_evaluation(out, frame_of(rows), origin_of(rows))
    files = ("report.html", "evaluation.html", "evaluation.md")
    return {name: (out / name).read_bytes().decode() for name in files}


def rows_of(name: str) -> list[dict[str, Any]]:
    """Two groups that share this title; more photons are worse."""
    head = {"dataset": name, "title": name, "photons_per_view": 1.0, "seconds": 1.0}
    entropy = [{"name": name, "entropy": {"1": 0.5, "2": 1.0}}]
    bound = {"name": name, "photons": 9, "log_gradient_per_px": 0.1, "depth_sigma_px": 0.5}
    reliability = {"0.9-1.0": {"share": 1.0, "confidence": 1.0, "correct": 0.5}}
    depth = {
        "depth": {"bad_1px": 0.5, "ece": 0.5, "reliability": reliability},
        "bounds": {"objects": [bound]},
    }
    removal = [
        head
        | {"recipe": f"{scene}{name}", "scene": scene, "settings": {"scene": scene, "x": 1}}
        | {"identity": f"{scene}{seed}{name}", "seed": seed, "budget": budget, "method": method}
        | {"planes": [{"z_mm": 1.0, "object": name, "truth": "object", "iou": iou}], "objects": entropy}
        for scene in (name, "other")
        for seed in (1, 2)
        for method in (name, "three-step")
        for budget, iou in ((NESTED, 0.9), (OWN, 0.5))
    ]
    taken = ("planes", "objects", "method")
    shown = [{key: row[key] for key in row if key not in taken} for row in removal if row["method"] == name]
    return removal + [row | {"method": "depth:focus"} | depth for row in shown]


@pytest.mark.parametrize("which", ["report.html", "evaluation.html"])
def test_a_page_has_nothing_but_its_own_elements(pages: dict[str, str], which: str) -> None:
    read = Read(pages[which])
    assert {tag for tag, _ in read.elements} <= ELEMENTS | OWN_ELEMENTS.get(which, set())
    for tag, attributes in read.elements:
        for name, value in attributes.items():
            assert not name.startswith("on"), tag
            assert name not in ("href", "srcdoc", "action"), tag
            if name == "src":
                assert tag == "img"
                assert re.match(r"data:image/(png|webp);base64,[A-Za-z0-9+/]+=*$", str(value))
    sent = [attributes for tag, attributes in read.elements if tag == "meta" and "http-equiv" in attributes]
    assert sent == [{"http-equiv": "Content-Security-Policy", "content": POLICIES[which]}]
    assert pages[which].index("Content-Security-Policy") < pages[which].index("<title>")


def test_the_script_of_the_report_is_ours_alone(pages: dict[str, str]) -> None:
    scripts = re.findall(r"<script[^>]*>(.*?)</script>", pages["report.html"], re.DOTALL | re.IGNORECASE)
    assert scripts == [SCRIPT.decode()]
    assert "<script" not in pages["evaluation.html"].lower()
    # It makes no markup, code or request from what is in the page.
    for word in (
        "innerHTML",
        "outerHTML",
        "insertAdjacent",
        "document.write",
        "eval",
        "Function(",
        "setTimeout",
    ):
        assert word.encode() not in SCRIPT
    for word in ("fetch", "XMLHttp", "import", "Storage", "cookie", "://", "Worker", "sendBeacon"):
        assert word.encode() not in SCRIPT


def test_all_names_show_as_text_in_the_report(pages: dict[str, str], outcome: Outcome) -> None:
    texts = Read(pages["report.html"]).texts
    assert texts.count(visible(NAMES[0])) > 4  # title, heading, object and method
    for name in NAMES:
        assert visible(name) in texts  # its object's row, and its method's rows
    assert any(text.startswith(visible(FOLDER)) for text in texts)
    assert outcome.dataset.name == FOLDER


def test_all_names_show_as_text_in_the_evaluation(pages: dict[str, str]) -> None:
    texts = Read(pages["evaluation.html"]).texts
    for name in NAMES:
        shown = visible(name)
        assert shown in texts  # method, object
        for scene in (shown, "other"):
            # The heading, and by method in both overviews.
            assert texts.count(f"{shown} (scene={scene})") == 1 + 2 + 1


def test_markdown_has_no_elements_links_or_torn_tables(pages: dict[str, str]) -> None:
    text = pages["evaluation.md"]
    assert "<" not in text
    assert ">" not in text
    assert not re.search(r"(?<!\\)\]\(", text)
    assert not re.search(r"(?<!\\)`", text)
    widths = [len(re.findall(r"(?<!\\)(?:\\\\)*\|", line)) for line in text.splitlines()]
    for line, above, width in zip(text.splitlines()[1:], widths, widths[1:], strict=False):
        if width and above:
            assert width == above, line
    for name in NAMES:
        assert in_markdown(name) in text
        # As Markdown reads it: a backslash before punctuation goes, and entities are what they stand for.
        read = html.unescape(re.sub(r"\\([!-/:-@\[-`{-~])", r"\1", in_markdown(name)))
        assert read == visible(name)
    lines = [line for line in text.splitlines() if line]
    assert all(re.match(r"\||#+ |Scores |p: |Depth: |In bold: |Over all scenes: ", line) for line in lines)


def test_what_a_page_lacks_is_no_empty_place() -> None:
    with pytest.raises(UndefinedError, match="notes"):
        page("evaluation.html.j2", {})


def test_names_of_files_that_are_no_characters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METHODS, "two rows", two_rows)
    data = write_dataset(tmp_path / "data \udcff", 1, {OWN: 5}, title="half \ud800")
    for _ in range(2):
        frame = evaluate([data], tmp_path / "out", methods=["two rows"]).frame
        assert set(frame["scene"]) == {"half \\ud800"}


def test_a_page_of_200_scenes_is_small_and_in_their_order(tmp_path: Path) -> None:
    lights, methods = (30.0, 100.0, 300.0, 1000.0, FULL_LIGHT), [f"depth:{letter}" for letter in "abcde"]
    rows = [
        {"dataset": "d", "identity": f"{scene} {seed}", "seed": seed, "recipe": str(scene), "seconds": 1.0}
        | {"title": f"scene {scene}", "budget": light, "method": method, "photons_per_view": 1.0}
        | {"depth": {"bad_1px": (scene + seed + number) / 210}}
        for scene in range(200)[::-1]
        for seed in (1, 2)
        for light in lights
        for number, method in enumerate(methods)
    ]
    (tmp_path / "rows.jsonl").touch()
    write_evaluation(tmp_path, frame_of(rows), origin_of(rows))
    text = (tmp_path / "evaluation.html").read_text()
    assert len(text) < 1_000_000
    assert text.count("data:image/png") == 1
    scenes = re.findall(r">(scene \d+)</td>", text)
    assert list(dict.fromkeys(scenes)) == [f"scene {number}" for number in range(200)[::-1]]
    # 0 to 199 over 210, and half of 1 and 2: the mean of all scenes.
    assert f"<td>{(199 / 2 + 1.5) / 210:.3f} (" in text
    assert MAX_DETAILED_SCENES < 200


def root_element(file: Path) -> str:
    """The root of the page's document after a browser has opened it, for two seconds of its own time."""
    command = [str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=2000"]
    command += [f"--user-data-dir={file.parent / 'profile'}", "--dump-dom", file.as_uri()]
    found = subprocess.run(command, capture_output=True, timeout=120, check=False).stdout
    return re.search(rb"<html[^>]*>", found)[0].decode() if found else ""  # type: ignore[index]


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_a_browser_carries_nothing_out(pages: dict[str, str], tmp_path: Path) -> None:
    torn = "<!doctype html><html><body>{}</body></html>"
    (tmp_path / "torn.html").write_text(torn.format("".join(NAMES[5:7])))
    if RAN not in root_element(tmp_path / "torn.html"):
        pytest.skip("this browser does not open pages here")
    for which in ("report.html", "evaluation.html"):
        for policy in (POLICIES[which], ""):  # escaping must do without it: older readers ignore policies
            assert POLICIES[which] in pages[which]
            (tmp_path / which).write_text(pages[which].replace(POLICIES[which], policy))
            assert root_element(tmp_path / which) == '<html lang="en">'

"""Intervals, paired tests and ranks: by hand, and by simulation with planted faults."""

import base64
import hashlib
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hostile_names import DO, NAMES
from stored_datasets import rewrite_manifest
from tiny_datasets import NESTED, OWN, two_rows, write_dataset

import pcii.figures
from pcii.app import analyse, write_report
from pcii.base import InputError, visible
from pcii.evaluation import frame_of, mean_interval, means, ranks, sign_flip_p, write_evaluation
from pcii.removal import METHODS
from pcii.sections import depth_range_of, planes_of
from pcii.store import open_dataset
from pcii.types import Segmented


def test_intervals_by_hand() -> None:
    # t(0.975, 2) = 4.302653; the standard deviation is 0.2: 4.302653 * 0.2 / sqrt(3) = 0.496828
    share = mean_interval([0.6, 0.8, 1.0], "share")
    assert share == pytest.approx((3, 0.8, 0.303172, 1.0), abs=1e-6)  # 1.297 is no share
    # Mean 2, deviation 1: 4.302653 / (2 sqrt(3)) = 1.242069, whose exponential is 3.462770.
    positive = mean_interval([1.0, 2.0, 3.0], "positive")
    assert positive == pytest.approx((3, 2.0, 2 / 3.462770, 2 * 3.462770), abs=1e-5)
    # Logarithms 0 and 2: mean 1, half 12.7062 * sqrt(2) / sqrt(2).
    geometric = mean_interval([1.0, np.exp(2.0)], "geometric")
    assert geometric == pytest.approx((2, np.e, np.exp(1 - 12.7062), np.exp(1 + 12.7062)), rel=1e-4)


@pytest.mark.parametrize("kind", ["signed", "share", "positive"])
def test_one_value_has_no_interval_and_equal_ones_one_without_width(kind: Any) -> None:
    one = mean_interval([0.4], kind)
    assert (one.n, one.mean) == (1, 0.4)
    assert np.isnan([one.low, one.high]).all()
    for value in (0.0, 0.5):
        assert mean_interval([value] * 3, kind) == (3, value, value, value)
    for values in ([], [0.5, float("nan")]):
        with pytest.raises(InputError, match="at least one finite number"):
            mean_interval(values, kind)
    with pytest.raises(InputError, match="at least 0"):
        mean_interval([1.0, -1.0], "positive")


TRIALS = 4000
# Share of trials that a 95 % interval covers: standard deviation sqrt(0.95 * 0.05 / 4000) = 0.0034.
TOLERANCE = 4 * 0.0034


def test_the_interval_covers_the_truth_as_often_as_it_says() -> None:
    rng = np.random.default_rng(3)
    covered, by_normal = 0, 0
    for x in rng.normal(0.5, 0.1, (TRIALS, 5)):
        found = mean_interval(x.tolist())
        covered += found.low <= 0.5 <= found.high
        by_normal += abs(x.mean() - 0.5) <= 1.96 * x.std(ddof=1) / np.sqrt(5)
    assert abs(covered / TRIALS - 0.95) < TOLERANCE
    # The planted fault: the normal distribution's 1.96 instead of Student's 2.78 covers 88 %.
    assert abs(by_normal / TRIALS - 0.95) > TOLERANCE


@pytest.mark.parametrize(
    ("differences", "p"),
    [
        ([1, 2, 3], 2 / 8),  # only all signs kept or all flipped are as far as 6
        ([1, 2, -3], 1.0),  # the sum is 0, and nothing is nearer
        ([4, 2, -1], 4 / 8),  # as far as 5: 4+2+1, 4+2-1 and their opposites
        ([0.1, 0.1, 0.1], 2 / 8),
        ([0, 0, 0, 0], 1.0),
        ([5], 1.0),
    ],
)
def test_few_signs_are_flipped_by_hand(differences: list[float], p: float) -> None:
    found, least_p = sign_flip_p(np.array(differences, dtype=float))
    assert found == pytest.approx(p)
    assert least_p == 2 / 2 ** len(differences)


A, B = "depth:a", "depth:b"


def row(scene: str, seed: int, method: str, within_1px: float, **depth: Any) -> dict[str, Any]:
    head = {"dataset": f"seed_{seed}", "identity": f"{scene} {seed}", "seed": seed, "seconds": 1.0}
    head |= {"recipe": scene, "title": scene, "budget": 30.0, "photons_per_view": 30.0}
    return head | {"method": method, "depth": {"within_1px": within_1px, **depth}}


BY_HAND = [
    row("cards", 1, A, 0.75),
    row("cards", 2, A, 0.25),
    row("cards", 1, B, 0.5),
    row("cards", 2, B, 0.0),
    row("slats", 1, A, 0.75),
    row("slats", 1, B, 0.25),
    row("slats", 2, B, 1.0),  # datasets that the other method has not seen
    row("slats", 3, A, 0.0),
    row("alone", 1, B, 1.0),  # and a scene
]


def test_each_scene_counts_once_with_the_seeds_that_all_methods_have() -> None:
    first, second = ranks(frame_of(BY_HAND), "within_1px").to_dict("records")
    # a: 0.5 and 0.75; b: 0.25 twice, so it is worse by 0.25 and 0.5, with 12.706 * 0.125 to either side.
    assert (first["light"], first["method"], first["rank"], first["n"], first["mean"]) == (30, A, 1, 2, 0.625)
    assert np.isnan([first["difference"], first["p"]]).all()
    assert (second["method"], second["rank"], second["mean"]) == (B, 2, 0.25)
    assert (second["low"], second["high"]) == (0.25, 0.25)
    ends = [second[name] for name in ("difference", "difference_low", "difference_high")]
    assert ends == pytest.approx([-0.375, -0.375 - 1.588, -0.375 + 1.588], abs=1e-3)
    assert second["p"] == second["least_p"] == 0.5


def test_one_method_over_many_scenes_has_one_mean_and_equal_methods_share_a_rank() -> None:
    (alone,) = ranks(frame_of([row(str(n), 1, A, n / 4) for n in range(4)]), "within_1px").to_dict("records")
    # Deviation 0.3227: 3.18245 * 0.3227 / 2 = 0.5136, and no share is below 0.
    found = [alone[name] for name in ("n", "mean", "low", "high")]
    assert found == pytest.approx([4, 0.375, 0, 0.8886], abs=1e-4)
    equal = frame_of([row(scene, 1, method, 0.5) for scene in ("cards", "slats") for method in (A, B)])
    assert ranks(equal, "within_1px")["rank"].tolist() == [1, 1]
    one_scene = frame_of(BY_HAND[:4])
    assert ranks(one_scene, "within_1px")["mean"].tolist() == [0.5, 0.25]
    with pytest.raises(InputError, match=r"^over: one scene .*; use over='datasets'"):
        ranks(one_scene, "within_1px", "scenes")


def test_means_are_over_the_seeds_that_have_a_value() -> None:
    def bins(share: float, confidence: float | None, correct: float | None) -> dict[str, Any]:
        return {"0.9-1.0": {"share": share, "confidence": confidence, "correct": correct}}

    rows = [
        row("t", 1, A, 0.5, ece=0.25, reliability=bins(1.0, 0.96, 0.5)),
        row("t", 2, A, 0.5, ece=0.75, reliability=bins(0.5, 0.92, 0.25)),
        row("t", 3, A, 0.5, ece=None, reliability=None),
        row("t", 4, A, 0.5, ece=0.5, reliability=bins(0.0, None, None)),
    ]
    table = means(frame_of(rows)).set_index("measure")
    expected = {"ece": (3, 0.5), "within_1px": (4, 0.5)}
    expected |= {"reliability.0.9-1.0.share": (3, 0.5), "reliability.0.9-1.0.confidence": (2, 0.94)}
    for measure, (n, mean) in expected.items():
        assert (table.at[measure, "n"], table.at[measure, "mean"]) == (n, pytest.approx(mean))


FOLDER = f'<img src=x onerror={DO}> "\u202e.d'
SHOWN = NAMES[:6]  # up to this number of scenes all tables are shown
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

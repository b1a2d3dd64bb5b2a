"""`pcii run` on datasets that no recipe made, and report.html, in headless Chromium too."""

import base64
import hashlib
import html
import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from command_runs import run_pcii as run

from pcii.app import Outcome, write_report
from pcii.evaluation import evaluate
from pcii.metrics import score
from pcii.sections import depth_range_of, reconstruct
from pcii.store import save_dataset, verify
from pcii.types import CameraGrid, DepthMap, PhotonCounts, Segmented, Truth, Views

GRID = CameraGrid(rows=2, cols=3, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.25, height=40, width=48)
COUNTS = PhotonCounts.from_dense(np.random.default_rng(1).poisson(0.2, GRID.shape_KLHW), GRID, cfa="GRBG")
LIGHT = Views(np.random.default_rng(0).random((*GRID.shape_KLHW, 3)).astype(np.float32), GRID)
IDS = np.zeros((40, 48), np.int16)
IDS[10:30, 8:20], IDS[12:28, 28:40] = 3, 7
Z_MM = np.select([IDS == 3, IDS == 7], [500.0, 700.0], np.inf)
TRUTH = Truth(Z_MM, IDS, {3: "ball", 5: "unseen", 7: "card"})
FOUND = np.where(IDS > 0, np.where(IDS > 0, Z_MM, 0) + np.linspace(-3, 5, 48), np.nan)


def outcome_of(root: Path, images: Any, truth: Truth | None, z_mm: tuple[float, ...] = (500, 700)) -> Outcome:
    """Results as `analyse` gives them, of a method that keeps the first object, with a depth by hand."""
    dataset = save_dataset(root, images, truth, z_mm=list(z_mm), title="By hand")
    sections = reconstruct(dataset.counts_or_views, z_mm)
    kept = Segmented(np.repeat((IDS == 3)[None], len(z_mm), axis=0), "by hand", sections)
    focus = (kept,) if dataset.has_counts else ()
    depth = DepthMap(FOUND, np.where(np.isfinite(FOUND), 0.75, 0.0))
    result = score(focus, depth, truth, grid=dataset.grid, dataset=dataset.name)
    full_light = None if dataset.views is None else reconstruct(dataset.views, z_mm)
    z_range_mm = depth_range_of(dataset)
    return Outcome(dataset, full_light, sections, focus, depth, result, z_range_mm, {"depth": 1.0})


class Written(NamedTuple):
    """Results, and the report of them."""

    outcome: Outcome
    page: str


def page_of(outcome: Outcome, folder: Path) -> str:
    write_report(folder / "report.html", outcome)
    return (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Written]:
    """Reports with everything, of counts alone, and of light alone; where nothing is true."""
    written: dict[str, Written] = {}
    contents = {"full": ((COUNTS, LIGHT), TRUTH), "counts": (COUNTS, None), "light": (LIGHT, None)}
    for name, (images, truth) in contents.items():
        folder = tmp_path_factory.mktemp(name)
        outcome = outcome_of(folder / "d", images, truth)
        written[name] = Written(outcome, page_of(outcome, folder))
    return written


def words_of(page: str) -> str:
    """What a reader sees of a page without its script and styles."""
    text = re.sub(r"<(script|style)>.*?</\1>", "", page, flags=re.DOTALL)
    return html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", text)))


def test_one_camera_has_one_section_for_all_depths(tmp_path: Path) -> None:
    grid = replace(GRID, rows=1, cols=1)
    counts = PhotonCounts.from_dense(np.ones(grid.shape_KLHW, int), grid)
    outcome = outcome_of(tmp_path / "d", counts, None, (500,))
    assert 'id="plane"' not in page_of(outcome, tmp_path)


def test_without_truth_or_counts_nothing_of_them_is_shown(reports: dict[str, Written]) -> None:
    words = words_of(reports["light"].page)
    assert "section at 700 mm, full light (Eq. 2)" in words
    assert "without photon counts" in words
    words = words_of(reports["counts"].page)
    assert "The truth is not known" in words
    for absent in ("None", "nan", "true depth", "IoU", "oracle", "compared", "recall", "–  –"):
        assert absent not in words, absent
    assert "by hand, 700 mm" in words


def test_what_is_shown_has_the_truth_beside(reports: dict[str, Written], tmp_path: Path) -> None:
    full, page = reports["full"].outcome, reports["full"].page
    words = words_of(page)
    of_truth = (
        "truth: objects at 500 mm",
        "by hand, 500 mm, compared with the truth",
        "true depth of the objects",
    )
    for shown in (*of_truth, "estimated less true depth"):
        assert shown in words, shown
    assert page.count('class="bar"') == 4
    assert f"ball {full.score.objects[0]['entropy']['500']:.3f}" in words
    # Fewer than two photons a voxel are smoothed.
    (width,) = set(re.findall(r"smoothed by ([\d.]+) px", page))
    assert 1 < float(width) < 4
    assert "methods by hand, depth:posterior" in words
    assert str(full.dataset.path.parent) not in words
    first, second = (each.split("How this was made")[0] for each in (page, page_of(full, tmp_path)))
    assert first == second  # dates and machines are below


WALL = Truth(np.full((40, 48), 600.0), 0 * IDS, {})


@pytest.mark.parametrize(("photons", "truth"), [(0, None), (3, TRUTH), (1, WALL)])
def test_hardly_any_photons_and_no_objects_divide_nothing(
    tmp_path: Path, photons: int, truth: Truth | None
) -> None:
    dense = np.zeros(GRID.shape_KLHW, int)
    dense[0, 0, 20, 12] = photons
    counts = PhotonCounts.from_dense(dense, GRID, cfa="GRBG")
    words = words_of(page_of(outcome_of(tmp_path / "d", counts, truth), tmp_path))
    assert f"{photons} photon{'s' * (photons != 1)} in all" in words
    assert "nan" not in words


CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
LOOK = """
const faults = [], all = (selector) => [...document.querySelectorAll(selector)];
for (const kind of ["error", "securitypolicyviolation"])
    addEventListener(kind, (event) => faults.push(event.message || event.blockedURI), true);
function look() {
    const slider = document.querySelector("#plane"), states = [];
    for (let value = 0; slider && value <= slider.max; value++) {
        slider.value = value;
        slider.dispatchEvent(new Event("input", {bubbles: true}));
        states.push([all("#look .frame img").filter((image) => !image.hidden).map((image) => image.alt),
            document.querySelector("#depth-shown").textContent, slider.getAttribute("aria-valuetext")]);
    }
    const fetched = performance.getEntriesByType("resource").map((entry) => entry.name);
    return {states, faults, fetched: fetched.filter((name) => !name.startsWith("data:")),
        text: document.body.innerText, overflow_px: document.documentElement.scrollWidth - innerWidth,
        wide: all(".wide").every((box) => box.getBoundingClientRect().right <= innerWidth)};
}
addEventListener("load", () => { document.title = JSON.stringify(look()); });
"""


def look_at(page: str, width: int, folder: Path) -> dict[str, Any]:
    """What `LOOK` finds on a copy of the page, whose policy names it beside the page's own script."""
    digest = base64.b64encode(hashlib.sha256(LOOK.encode()).digest()).decode()
    policy = page.replace("script-src '", f"script-src 'sha256-{digest}' '", 1)
    copy = folder / "report.html"
    copy.write_text(policy.replace("<title>", f"<script>{LOOK}</script><title>", 1), encoding="utf-8")
    command = [str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", f"--window-size={width},1000"]
    command += [f"--user-data-dir={folder / 'profile'}", "--dump-dom", copy.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    (title,) = re.findall("<title>(.*?)</title>", done.stdout, re.DOTALL)
    return json.loads(html.unescape(title))


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
@pytest.mark.parametrize(("name", "width"), [("full", 1200), ("full", 500), ("counts", 500), ("light", 1200)])
def test_the_slider_moves_and_nothing_is_fetched_logged_or_cut_off(
    reports: dict[str, Written], name: str, width: int, tmp_path: Path
) -> None:
    seen = look_at(reports[name].page, width, tmp_path)
    assert (seen["faults"], seen["fetched"], seen["wide"]) == ([], [], True)
    assert seen["overflow_px"] <= 0
    assert "NaN" not in seen["text"]
    depths = [float(text.split()[0]) for _, text, _ in seen["states"]]
    assert len(depths) > 2
    assert depths == sorted(set(depths))
    assert all(images == [text] and text == spoken for images, text, spoken in seen["states"])


FAST = ["--method", "brightness", "--depth-method", "variance-sweep"]


def test_photon_counts_of_a_stranger_are_analysed(tmp_path: Path, capsys) -> None:
    texts: dict[str, Any] = {"title": "Mine", "licence": "CC-BY", "origin": "a lab"}
    dataset = save_dataset(tmp_path / "d", COUNTS, z_mm=[500, 700], **texts)
    assert run("run", tmp_path / "d", "-o", tmp_path / "out", *FAST) == 0
    page = (tmp_path / "out" / "report.html").read_text()
    for text in ("<h1>Mine</h1>", "CC-BY", "a lab", dataset.manifest["identity"][:16]):
        assert text in page
    capsys.readouterr()
    assert run("score", tmp_path / "d", tmp_path / "out") == 0
    assert "has no truth" in capsys.readouterr().out
    assert verify(tmp_path / "out") > 5


def test_a_depth_named_twice_is_one_plane(tmp_path: Path) -> None:
    save_dataset(tmp_path / "d", COUNTS, TRUTH, z_mm=[700, 500, 500.0001, 700], z_range_mm=(400, 900))
    assert run("run", tmp_path / "d", "-o", tmp_path / "out", *FAST) == 0
    found = json.loads((tmp_path / "out" / "score.json").read_text())
    assert [(row["z_mm"], row["object"]) for row in found["planes"][::2]] == [(700, "card"), (500, "ball")]
    assert run("evaluate", tmp_path / "d", "-o", tmp_path / "e", "--method", "brightness") == 0
    rows = json.loads((tmp_path / "e" / "rows.jsonl").read_text())
    assert [row["object"] for row in rows["planes"][::2]] == ["card", "ball"]
    (tmp_path / "d").rename(tmp_path / "other depths")
    save_dataset(tmp_path / "d", COUNTS, TRUTH, z_mm=[500], z_range_mm=(400, 900))
    for expected in (1, 0):
        evaluation = evaluate([tmp_path / "d"], tmp_path / "e", methods=["brightness"])
        assert evaluation.frame["z_mm"].unique().tolist() == [500]
        assert len(evaluation.made_again) == expected


def test_radiance_alone_gives_sections_depth_and_a_report(tmp_path: Path, capsys) -> None:
    # Surfaces without names, as in benchmarks of depth.
    save_dataset(tmp_path / "d", LIGHT, Truth(np.full((40, 48), 500.0), 0 * IDS, {}), z_mm=500)
    assert run("run", tmp_path / "d", "-o", tmp_path / "out") == 0
    assert "sections and depth only" in capsys.readouterr().out
    assert verify(tmp_path / "out") > 3


@pytest.mark.parametrize("command", [["segment"], ["run", "--method", "posterior"]])
def test_what_needs_photons_says_so(tmp_path: Path, command, capsys) -> None:
    save_dataset(tmp_path / "d", LIGHT, z_mm=500)
    assert run(command[0], tmp_path / "d", "-o", tmp_path / "out", *command[1:]) == 2
    assert "no photon counts; import the images with --photons N" in capsys.readouterr().err


def test_depths_that_nothing_suggests_are_named_by_options(tmp_path: Path, capsys) -> None:
    grid = replace(GRID, cols=2)
    dim = np.random.default_rng(1).poisson(0.2, grid.shape_KLHW)
    save_dataset(tmp_path / "d", PhotonCounts.from_dense(dim, grid, cfa="GRBG"))
    out = tmp_path / "out"
    assert run("segment", tmp_path / "d", "-o", out) == 2
    assert "suggests no depths; name depths with --z-mm" in capsys.readouterr().err
    assert run("depth", tmp_path / "d", "-o", out) == 2
    assert "or a range with --z-range-mm" in capsys.readouterr().err
    assert run("depth", tmp_path / "d", "-o", out, "--z-range-mm", 450, 700) == 0
    assert "depth.png: 450 mm is yellow, 700 mm violet" in capsys.readouterr().out
    found = ["run", tmp_path / "d", "-o", out, "--z-range-mm", 400, 900, *FAST]
    assert run(*found) == 2
    assert "no depth is found in the range; name depths with --z-mm" in capsys.readouterr().err
    texture = np.random.default_rng(2).gamma(0.5, 40, (40, 48))  # 2 px from view to view are 500 mm
    wall = [[np.roll(texture, (-2 * k, -2 * l), (0, 1)) for l in range(2)] for k in range(2)]
    photons = np.random.default_rng(3).poisson(wall)
    save_dataset(tmp_path / "wall", PhotonCounts.from_dense(photons, grid))
    assert run("run", tmp_path / "wall", "-o", tmp_path / "seen", *found[4:-2]) == 0
    (depths,) = re.findall(r"the depth map has most surfaces at ([\d., ]+) mm;", capsys.readouterr().out)
    assert min(abs(float(text) - 500) for text in depths.split(",")) < 30
    assert run(*found, "--z-mm", 600) == 0
    assert run("depth", tmp_path / "d", "-o", out, "--z-range-mm", 700, 400) == 2
    assert "near must be less than far" in capsys.readouterr().err

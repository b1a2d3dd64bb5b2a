"""Methods run on a small benchmark, maps made elsewhere, folders with faults, and names."""

import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pandas as pd
import pytest
from command_runs import run_pcii

import pcii
from pcii.base import InputError
from pcii.evaluation import (
    SUBMISSION,
    BenchmarkHalf,
    Evaluation,
    Submission,
    open_benchmark,
    read_submission,
    run_method,
    score_submission,
    write_page,
)
from pcii.store import EVALUATION_FOLDER, INDEX, ROWS, list_files, read_index, verify, write_index

pytestmark = pytest.mark.renders
HALF = "development"
DEPTH, MASKS = (f"pair_photons_1/1000/{name}.npz" for name in ("depth", "masks"))
SHAPE = (66, 70)
Change = Callable[[Path], object]


def edit(name: str, old: str, new: str, *, lists: bool = True) -> Change:
    """Replaces a text, and `lists` the files anew, as whoever changes scores on purpose would."""

    def change(folder: Path) -> None:
        (folder / name).write_text(re.sub(old, lambda _: new, (folder / name).read_text(), count=1))
        if lists:
            files = list_files(folder, [ROWS, SUBMISSION, "evaluation.html", "means.csv"])
            EVALUATION_FOLDER.write(folder, {"files": files})

    return change


def link(name: str) -> Change:
    """Puts a link to the file outside the folder in its place."""
    return lambda folder: (folder / name).symlink_to((folder / name).rename(folder.parent / "x"))


def depth(z_mm: object) -> Change:
    """Another depth map: of one value."""
    return lambda folder: np.savez(folder / DEPTH, z_mm=np.full(SHAPE, z_mm))


NUMBERS = r"expected numbers z_mm \(66, 70\), confidence \(66, 70\), of which z_mm is needed"
# What is done to a good submission, and what is said of it.
FAULTS: list[tuple[Change, str]] = [
    (edit(SUBMISSION, "small", "large", lists=False), "benchmark: is 'large', but .* 'small'"),
    (
        lambda f: shutil.copytree(f / "pair_photons_1", f / "pear_photons_1"),
        "pear_photons_1/.*: is no result of this half, .* files DATASET/LIGHT/depth.npz or masks.npz",
    ),
    (
        lambda f: shutil.rmtree(f / "pair_photons_2" / "1000"),
        r"pair_photons_2/1000/\w+.npz: is missing, and of this light it is needed of all datasets$",
    ),
    (lambda f: np.savez(f / MASKS, in_focus=np.full((2, *SHAPE), 0.5)), "in_focus: expected 0 and 1"),
    (lambda f: np.savez(f / DEPTH, z_mm=np.ones((66, 7))), NUMBERS),
    (depth(None), "depth.npz: damaged, or no .npz file of numbers as numpy.savez writes it$"),
    (lambda f: ZipFile(f / DEPTH, "w").writestr("z_mm", "1"), NUMBERS),
    (depth(-1.0), "z_mm: expected 0.001 to 1e.12 mm"),
    (lambda f: os.truncate(f / DEPTH, 999), "depth.npz: damaged, or no .npz file of numbers"),
    (
        link(DEPTH),
        "depth.npz: is no result of this half, or a link out of the folder; expected files DATASET",
    ),
]
# What is done to scores of which a page is made, and what is said of it.
CHANGES: list[tuple[Change, str]] = [
    (edit(ROWS, '"iou": 0', '"iou": 1', lists=False), f"{ROWS}.*; .* make or score it again"),
    (lambda f: (f / "evaluation.json").unlink(), "theirs: not a finished evaluation"),
    (edit(ROWS, '"iou": [0-9.]+', '"iou": "0.5"'), "line 1: planes.0.scores.iou: .* a valid number"),
    (edit(ROWS, '"iou"', '"method"'), "line 1: planes.0.scores: 'method' is no name"),
    (edit(ROWS, '"planes"', '"other"'), "line 1: is no row of scores"),
    (link(ROWS), f"{ROWS}: is a link; a folder of scores holds its files themselves"),
]


@pytest.fixture(scope="module")
def data(small_benchmark: Path) -> BenchmarkHalf:
    return open_benchmark(small_benchmark, HALF)


@pytest.fixture(scope="module")
def submitted(data: BenchmarkHalf, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The masks by "brightness" and the depth by "variance-sweep" as somebody else would send them."""
    folder = tmp_path_factory.mktemp("submitted")
    (folder / SUBMISSION).write_text(json.dumps({"benchmark": "small", "method": "mine", "authors": "A. N."}))
    for dataset in data.datasets:
        z_range_mm = tuple(dataset.analysis["z_range_mm"])
        for light in dataset.lights:
            chosen = dataset.at_light(light)
            inside = folder / dataset.name / str(light)
            inside.mkdir(parents=True)
            depth = pcii.estimate_depth(chosen.counts_or_views, z_range_mm, method="variance-sweep")
            np.savez(inside / "depth.npz", z_mm=depth.z_mm, confidence=depth.confidence)
            if dataset.has_counts:
                focus = pcii.segment(chosen.counts, dataset.analysis["z_mm"], method="brightness")
                np.savez(inside / "masks.npz", in_focus=focus.in_focus)
    return folder


@pytest.fixture(scope="module")
def scored(data: BenchmarkHalf, submitted: Path, tmp_path_factory: pytest.TempPathFactory) -> Evaluation:
    return score_submission(submitted, data, tmp_path_factory.mktemp("scored") / "given")


def test_maps_made_elsewhere_score_as_the_method_that_made_them(
    data: BenchmarkHalf, scored: Evaluation, tmp_path: Path
) -> None:
    given = scored.frame
    for method, name in (("brightness", "mine"), ("depth:variance-sweep", "depth:mine")):
        run = run_method(method, data, tmp_path / method.replace(":", "-")).frame
        mine = given[given["method"] == name].reset_index(drop=True)
        keys = ["identity", "light", "z_mm"]
        one, other = (table.sort_values(keys, ignore_index=True) for table in (run, mine))
        assert one["dataset"].tolist() == other["dataset"].tolist()
        assert set(one["scene"]) == {"pair", "pair, binary frames"}
        columns = [*keys, "iou" if method == "brightness" else "within_1px", "photons_per_view"]
        pd.testing.assert_frame_equal(one[columns], other[columns], check_categorical=False)
        assert other["seconds"].isna().all()
    assert mine["light"].cat.categories.tolist() == [30.0, 1000.0, 3000.0, "full-light"]
    of_pair = mine[mine["scene"] == "pair"].groupby("light", observed=True)["identity"]
    assert of_pair.nunique().tolist() == [3, 3, 1, 1]
    about = json.loads((scored.folder / SUBMISSION).read_text())
    assert (about["method"], about["authors"], about["half"]) == ("mine", "A. N.", HALF)
    verify(scored.folder)
    few, many = (mine[mine["light"] == light]["bound_px"].mean() for light in (30.0, 3000.0))
    assert few == pytest.approx(10 * many, rel=0.2)  # as the root of the photons


def test_functions_of_ones_own_are_run_each_into_a_folder_of_its_own(
    small_benchmark: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a_method_of_mine.py").write_text(
        "import numpy as np, pcii\n"
        "def everything(counts, sections):\n"
        "    return pcii.Segmented(sections.counts[..., 0] >= 0, 'everything', sections)\n"
        "def near(data, z_range_mm):\n"
        "    film = data.grid.shape_HW\n"
        "    return pcii.DepthMap(np.full(film, z_range_mm[0]), np.ones(film))\n"
    )
    monkeypatch.chdir(tmp_path)
    options = ["--data", str(small_benchmark), "--half", HALF]
    methods = ("a_method_of_mine.py:everything", "depth:a_method_of_mine:near")
    for method, out in zip(methods, ("masks", "depth"), strict=True):
        command = ["benchmark", "run", method, *options, "--budget", "30"]
        assert run_pcii(*command, "-o", f"submissions/{out}") == 0
    # The commands that the page prints, with the folder of the benchmark, find the rows and measure nothing.
    assert run_pcii("benchmark", "page", "submissions", "-o", "page.html") == 0
    commands = re.findall("pcii (benchmark run .*?)</td>", (tmp_path / "page.html").read_text())
    assert [command.split()[2] for command in commands] == [methods[1], methods[0]]
    rows = tmp_path / commands[0].split()[-1] / "rows.jsonl"
    before = rows.stat().st_size
    repeated = commands[0].replace("BENCHMARK", str(small_benchmark)).split()
    assert run_pcii(*repeated, "--budget", "30") == 0
    assert rows.stat().st_size == before
    absent = ["benchmark", "run", methods[0], *options, "--budget", "77", "-o", "other"]
    assert run_pcii(*absent) == 2
    assert "no dataset of the development half that" in capsys.readouterr().err
    assert not (tmp_path / "other").exists()


def test_one_page_has_all_submissions(data: BenchmarkHalf, scored: Evaluation, tmp_path: Path) -> None:
    folder, out = tmp_path / "submissions", tmp_path / "page.html"
    shutil.copytree(scored.folder, folder / "theirs")
    about = {"authors": "B. C.", "url": None, "trained_on": "drawn scenes"}
    run_method("depth:sweep-17", data, folder / "ours", **about)
    edit(SUBMISSION, r'"command_name": "[^"]*', '"command_name": "net:a; b')(folder / "ours")
    assert run_pcii("benchmark", "page", folder, "-o", out) == 0
    text = out.read_text()
    assert "small: methods compared" in text
    for words in ("mine", "depth:mine", "depth:sweep-17", "B. C.", "drawn scenes"):
        assert re.search(f">{re.escape(words)}</t[hd]>", text)
    assert "pcii benchmark score MAPS --data BENCHMARK --half development -o submissions/theirs" in text
    assert "pcii benchmark run &#39;net:a; b&#39; --data" in text  # as one word of a shell
    with pytest.raises(InputError, match="theirs: holds scores of 'depth:mine'; name another folder"):
        run_method("brightness", data, folder / "theirs")
    assert out.read_text() == text


@pytest.mark.parametrize(("make", "says"), CHANGES)
def test_no_page_is_made_of_scores_that_were_changed(
    make: Change, says: str, scored: Evaluation, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = tmp_path / "submissions" / "theirs", tmp_path / "page.html"
    shutil.copytree(scored.folder, folder)
    make(folder)
    assert run_pcii("benchmark", "page", folder.parent, "-o", out) == 2
    assert re.fullmatch(f"error: .*{says}.*\n", capsys.readouterr().err)
    assert not out.exists()


@pytest.mark.parametrize(("make", "says"), FAULTS)
def test_submissions_with_faults_are_answered_in_a_sentence(
    make: Change, says: str, data: BenchmarkHalf, submitted: Path, tmp_path: Path
) -> None:
    broken = tmp_path / "broken"
    shutil.copytree(submitted, broken)
    make(broken)
    with pytest.raises(InputError, match=says):
        score_submission(broken, data, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_unfinished_benchmark_names_the_command_that_goes_on(
    small_benchmark: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    part = shutil.copytree(small_benchmark, tmp_path / "part")
    write_index(part, [row for row in read_index(part) if "photons" not in row["path"]])
    command = ["benchmark", "run", "brightness", "--data", str(part), "-o", str(tmp_path / "out")]
    assert run_pcii(*command, "--half", HALF) == 0
    printed = capsys.readouterr().out
    assert f"{part}: 3 of 5 datasets of the {HALF} half are missing" in printed
    assert f"`simgen benchmark make -o {part}` goes on with it" in printed
    (part / INDEX).unlink()
    with pytest.raises(InputError, match=r"unfinished; the same `simgen benchmark make -o .*` goes on"):
        open_benchmark(part, HALF)


def about(folder: Path, **members: str) -> Path:
    (folder / SUBMISSION).write_text(json.dumps({"benchmark": "b", "method": "net"} | members))
    return folder


def test_names_are_of_any_language_and_none_is_taken_for_another(tmp_path: Path) -> None:
    says = f"{SUBMISSION}: method: (expected a name of characters|the name '.*' is taken; choose another one)"
    for name in ("(nothing)", "Brightness", "depth:net", "my\u200bnet", "my  net", "\uff4eet", "net\u2800"):
        with pytest.raises(InputError, match=says):
            read_submission(about(tmp_path, method=name), Submission)
    for name in ("Größe 2.1", "β-net, 3rd try", "深層ネット", "U-Net + CRF"):
        assert read_submission(about(tmp_path, method=name), Submission).methods == (f"depth:{name}", name)
    good = {"authors": "José O’Brien & 李明", "url": "https://example.org/a?b=c#d"}
    assert read_submission(about(tmp_path, **good), Submission).model_dump().items() >= good.items()
    with pytest.raises(InputError, match=f"{SUBMISSION}: url: .* '.https"):
        read_submission(about(tmp_path, url="javascript:x"), Submission)


def test_a_page_has_each_name_once_whatever_its_case(scored: Evaluation, tmp_path: Path) -> None:
    for folder, name in (("ours", "mine"), ("theirs", "Mine")):
        shutil.copytree(scored.folder, tmp_path / folder)
        edit(SUBMISSION, '"method": "mine"', f'"method": "{name}"')(tmp_path / folder)
    with pytest.raises(InputError, match=r"ours and theirs are both of 'Mine', in upper or lower case$"):
        write_page(tmp_path, tmp_path / "page.html")
    edit(SUBMISSION, '"Mine"', '"yours"')(tmp_path / "theirs")
    with pytest.raises(InputError, match=r"rows\.jsonl: has rows of '.*mine', which submission.json"):
        write_page(tmp_path, tmp_path / "page.html")

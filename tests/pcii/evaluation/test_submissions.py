"""Methods run on a small benchmark, maps made elsewhere, and submissions with faults."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pcii
from pcii.app.commands import app
from pcii.base import command_line
from pcii.base.errors import InputError
from pcii.evaluation.benchmark_collection import open_benchmark
from pcii.evaluation.benchmark_page import KINDS, write_page
from pcii.evaluation.submission_checks import SUBMISSION
from pcii.evaluation.submission_scores import run_method, score_submission
from pcii.exchange.export_pictures import write_pfm, write_png
from pcii.store.verification import verify

pytestmark = pytest.mark.renders
HALF = "development"


def datasets(benchmark: Path) -> list[pcii.Dataset]:
    return open_benchmark(benchmark).datasets(HALF)


def figures(result: dict[str, Any], method: str) -> dict[tuple[str, Any], dict[str, Any]]:
    """Results of a method by title and light."""
    return {
        (group["title"], row["budget"]): row
        for group in result["groups"]
        for row in group["results"]
        if row["method"] == method
    }


def means(row: dict[str, Any]) -> dict[str, float]:
    """Means over seeds of the scores of masks or depth; NaN for those that are not defined."""
    scores = row.get("object") or row["depth"]
    known = {name: mean or {"mean": np.nan} for name, mean in scores.items()}
    return {name: mean["mean"] for name, mean in known.items() if "mean" in mean}


@pytest.fixture(scope="module")
def submitted(small_benchmark: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The masks by "variance" and the depth by "variance-sweep" as somebody else would send them."""
    folder = tmp_path_factory.mktemp("submitted")
    (folder / SUBMISSION).write_text(json.dumps({"benchmark": "small", "method": "mine", "authors": "A. N."}))
    for number, dataset in enumerate(datasets(small_benchmark)):
        z_range_mm = tuple(dataset.analysis["z_range_mm"])
        for light in dataset.budgets if dataset.has_counts else ("full-light",):
            data = dataset.at_budget(light)
            inside = folder / dataset.name / (light if isinstance(light, str) else f"{light:g}")
            inside.mkdir(parents=True)
            depth = pcii.estimate_depth(data.counts_or_views, z_range_mm, method="variance-sweep")
            if number % 2:
                write_pfm(inside / "depth.pfm", depth.z_mm)
                write_pfm(inside / "confidence.pfm", depth.confidence)
            else:
                np.savez(inside / "depth.npz", z_mm=depth.z_mm, confidence=depth.confidence)
            if not dataset.has_counts:
                continue
            focus = pcii.segment(data.counts, dataset.analysis["z_mm"], method="variance")
            if number % 2:
                for z, mask in zip(focus.z_mm, focus.in_focus, strict=True):
                    write_png(inside / f"mask_{z:g}.png", (mask * 255).astype(np.uint8))
            else:
                np.savez(inside / "masks.npz", in_focus=focus.in_focus)
    return folder


def test_maps_made_elsewhere_score_as_the_method_that_made_them(
    small_benchmark: Path, submitted: Path, tmp_path: Path
) -> None:
    data = open_benchmark(small_benchmark)
    given = score_submission(submitted, data, tmp_path / "given", half=HALF)
    for method, name in (("variance", "mine"), ("depth:variance-sweep", "depth:mine")):
        run = run_method(method, data, tmp_path / method.replace(":", "-"), half=HALF)
        expected, found = figures(run, method), figures(given, name)
        assert expected.keys() == found.keys()
        titles = {title for title, _ in found}
        assert titles == {"pair", "pair, binary frames"}
        for key, row in expected.items():
            one, other = means(row), means(found[key])
            assert one.keys() == other.keys()
            # Of single precision in PFM.
            np.testing.assert_allclose([*one.values()], [*other.values()], rtol=1e-4, atol=2e-4)
    assert {budget for _, budget in found} == {30.0, 1000.0, 3000.0, "full-light"}
    assert found["pair", 1000.0]["seeds"] == 3
    assert found["pair", 3000.0]["seeds"] == 1
    said = json.loads((tmp_path / "given" / SUBMISSION).read_text())
    assert (said["method"], said["authors"], said["half"]) == ("mine", "A. N.", HALF)
    assert "peak_memory_mb" not in said  # which is that of others
    assert json.loads((tmp_path / "variance" / SUBMISSION).read_text())["peak_memory_mb"] > 0
    verify(tmp_path / "given")
    few, many = (
        [entry["depth_sigma_px"]["mean"] for entry in found["pair", photons]["bounds"]["objects"]]
        for photons in (30.0, 3000.0)
    )
    assert few == pytest.approx([10 * sigma for sigma in many], rel=0.2)  # as the root of the photons


def test_a_function_of_ones_own_is_run(
    small_benchmark: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a_method_of_mine.py").write_text(
        "import numpy as np, pcii\n"
        "def everything(counts, sections):\n"
        "    shape = sections.counts.shape[:3]\n"
        "    return pcii.Segmented(np.ones(shape, bool), 'everything', sections)\n"
    )
    monkeypatch.chdir(tmp_path)
    arguments = ["benchmark", "run", "a_method_of_mine:everything", "--data", str(small_benchmark)]
    assert command_line.run(app, [*arguments, "-o", "out", "--half", HALF, "--budget", "30"]) == 0
    result = json.loads((tmp_path / "out" / "evaluation.json").read_text())
    assert figures(result, "everything")["pair", 30.0]["object"]["recall"]["mean"] == 1
    for wrong in ("a_method_of_mine:nothing", "no_such_module:everything", "no-such-method"):
        assert command_line.run(app, [*arguments[:2], wrong, *arguments[3:], "-o", "other"]) == 2
        assert wrong in capsys.readouterr().err
    assert command_line.run(app, [*arguments, "-o", "other", "--half", HALF, "--budget", "77"]) == 2
    assert "no dataset of the development half that 'everything' can take has 77" in capsys.readouterr().err
    assert not (tmp_path / "other").exists()


def test_one_page_has_all_submissions(small_benchmark: Path, submitted: Path, tmp_path: Path) -> None:
    data, folder, out = open_benchmark(small_benchmark), tmp_path / "submissions", tmp_path / "page.html"
    score_submission(submitted, data, folder / "theirs", half=HALF)
    run_method("depth:posterior", data, folder / "ours", half=HALF)
    assert command_line.run(app, ["benchmark", "page", str(folder), "-o", str(out)]) == 0
    text = out.read_text()
    assert "small: methods compared" in text
    for method in (
        "mine",
        "depth:mine",
        "depth:posterior",
        *(kind.bound for kind in KINDS if kind.bound),
    ):
        assert f">{method}</td>" in text
    # One scene of each, with its picture.
    assert re.findall(r'<img src="data:image/webp[^>]*alt="([^"]*)"', text) == [
        f"Truth and result of {method}: pair" for method in ("mine", "depth:mine", "depth:posterior")
    ]
    assert "pcii benchmark score MAPS --data BENCHMARK --half development -o OUT" in text
    shutil.copytree(folder / "ours", folder / "again")
    with pytest.raises(InputError, match="again and ours are both of 'depth:posterior'"):
        write_page(folder, out)
    with pytest.raises(InputError, match="is a submission; name the folder that it is in"):
        write_page(folder / "ours", out)
    with pytest.raises(InputError, match="theirs: holds scores of 'depth:mine'; name another folder"):
        run_method("variance", data, folder / "theirs", half=HALF)
    assert out.read_text() == text


def rewritten(path: Path, **arrays: Any) -> None:
    np.savez(path, **arrays)


SHAPE = (130, 140)
# What is done to a good submission, and what is said of it.
FAULTS: dict[str, tuple[Callable[[Path], object], str]] = {
    "no submission.json": (lambda f: (f / SUBMISSION).unlink(), "submission.json: is missing; expected"),
    "another benchmark": (
        lambda f: (f / SUBMISSION).write_text('{"benchmark": "large", "method": "mine"}'),
        "benchmark: is 'large', but the data are of 'small'",
    ),
    "a method's name that is taken": (
        lambda f: (f / SUBMISSION).write_text('{"benchmark": "small", "method": "likelihood"}'),
        "method: methods: the name 'likelihood' is taken",
    ),
    "a dataset that is not there": (
        lambda f: (f / "pear_photons_1").mkdir(),
        "pear_photons_1: there is no such dataset in this half",
    ),
    "light that is not there": (
        lambda f: (f / "pair_photons_1" / "500").mkdir(),
        "500: is no light of this dataset, of which there are 30, 1000, 3000",
    ),
    "an empty folder": (
        lambda f: [each.unlink() for each in (f / "pair_photons_1" / "1000").iterdir()],
        "1000: has neither a depth map",
    ),
    "missing pieces": (
        lambda f: shutil.rmtree(f / "pair_photons_2" / "1000"),
        "pair_photons_2/1000: is missing, and of this light it is needed of all datasets$",
    ),
    "masks of all datasets but one": (
        lambda f: (f / "pair_photons_1" / "1000" / "masks.npz").unlink(),
        r"pair_photons_1/1000: has no masks\.npz, and of this light it is needed of all datasets",
    ),
    "a field that is not known": (
        lambda f: (f / SUBMISSION).write_text('{"benchmark": "small", "method": "mine", "author": "A. N."}'),
        "submission.json: author: is not known; expected",
    ),
    "a map of another size": (
        lambda f: rewritten(f / "pair_photons_1" / "1000" / "depth.npz", z_mm=np.ones((130, 14))),
        r"depth.npz: z_mm: expected numbers \(130, 140\), got float64 \(130, 14\)",
    ),
    "depths below 0": (
        lambda f: rewritten(f / "pair_photons_1" / "1000" / "depth.npz", z_mm=-np.ones(SHAPE)),
        "depth.npz: z_mm: depths are above 0 mm",
    ),
    "confidence above 1": (
        lambda f: rewritten(
            f / "pair_photons_1" / "1000" / "depth.npz", z_mm=np.ones(SHAPE), confidence=2 * np.ones(SHAPE)
        ),
        "confidence: expected numbers from 0 to 1",
    ),
    "other arrays": (
        lambda f: rewritten(f / "pair_photons_1" / "1000" / "depth.npz", disparity=np.ones(SHAPE)),
        r"depth.npz: expected the arrays z_mm, confidence \(if known\), got disparity",
    ),
    "objects": (
        lambda f: rewritten(f / "pair_photons_1" / "1000" / "depth.npz", z_mm=np.full(SHAPE, None)),
        "depth.npz: damaged, or no .npz file of plain numbers",
    ),
    "a file that is none": (
        lambda f: (f / "pair_photons_1" / "1000" / "masks.npz").write_bytes(b"PK"),
        "masks.npz: damaged, or no .npz file",
    ),
    "masks of shares": (
        lambda f: rewritten(f / "pair_photons_1" / "1000" / "masks.npz", in_focus=np.full((2, *SHAPE), 0.5)),
        "in_focus: expected 0 and 1",
    ),
    "a mask of another depth": (
        lambda f: (f / "pair_photons_2" / "1000").joinpath("mask_7.png").write_bytes(b""),
        "mask_7.png: the depths are",
    ),
    "two depth maps": (
        lambda f: write_pfm(f / "pair_photons_1" / "1000" / "depth.pfm", np.ones(SHAPE)),
        "depth.pfm: depth.npz is there too",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_submissions_with_faults_are_answered_in_a_sentence(
    fault: str, small_benchmark: Path, submitted: Path, tmp_path: Path
) -> None:
    make, says = FAULTS[fault]
    broken = tmp_path / "broken"
    shutil.copytree(submitted, broken)
    make(broken)
    with pytest.raises(InputError, match=says):
        score_submission(broken, open_benchmark(small_benchmark), tmp_path / "out", half=HALF)
    assert not (tmp_path / "out").exists()


def test_a_collection_that_is_no_benchmark_is_refused(tmp_path: Path, small_benchmark: Path) -> None:
    with pytest.raises(InputError, match="is no benchmark; make one with `simgen benchmark make`"):
        open_benchmark(tmp_path)
    folder = tmp_path / "empty"
    folder.mkdir()
    (folder / SUBMISSION).write_text('{"benchmark": "small", "method": "mine"}')
    with pytest.raises(InputError, match="has no results of a dataset of the test half"):
        score_submission(folder, open_benchmark(small_benchmark), tmp_path / "out")

"""An analysis that was interrupted goes on: what is finished and valid is kept, with the same bytes."""

from pathlib import Path

import pytest

import pcii
from pcii.app import long_steps, pipeline, single_run
from pcii.app.results import masks_name
from pcii.base.errors import InputError
from pcii.store.dataset import Dataset
from pcii.store.folders import read_results
from pcii.store.verification import verify
from pcii.types.estimates import DepthMap, Segmented

METHODS = ("brightness", "variance")
REMOVALS = tuple(long_steps.removal_step(method) for method in METHODS)
ALL = (*REMOVALS, long_steps.DEPTH_STEP)
VARIES = {"report.html", "results.json"}
"""They tell how long steps took."""


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    return pcii.sample()


@pytest.fixture(scope="module")
def whole(dataset: Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a run that nothing interrupted."""
    out = tmp_path_factory.mktemp("whole") / "results"
    assert run(dataset, out) == ()
    return out


def run(dataset: Dataset, out: Path, **options: object) -> tuple[str, ...]:
    """Names of the steps that the run kept."""
    settings = {"z_mm": None, "methods": METHODS, "depth_method": "variance-sweep"} | options
    return single_run.run(dataset, out, **settings).kept  # type: ignore[arg-type]


def contents(out: Path) -> dict[str, bytes]:
    files = {file.relative_to(out).as_posix(): file for file in out.rglob("*") if file.is_file()}
    return {name: file.read_bytes() for name, file in files.items() if name not in VARIES}


def interrupted(
    dataset: Dataset,
    out: Path,
    monkeypatch: pytest.MonkeyPatch,
    at: str = "estimate_depth",
    **options: object,
) -> None:
    """A run that is stopped where it calls `at`; by default in its last long step."""

    def stop(*_: object, **__: object) -> DepthMap:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(pipeline, at, stop)
        with pytest.raises(KeyboardInterrupt):
            run(dataset, out, **options)


def test_an_interrupted_run_goes_on_to_the_same_bytes(
    dataset: Dataset, whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    interrupted(dataset, out, monkeypatch)
    assert not (out / "score.json").exists()
    with pytest.raises(InputError, match=r"finished: depth.zarr, report.html, score.json, sections.zarr "):
        verify(out)
    assert run(dataset, out) == REMOVALS
    assert verify(out) > 0
    assert contents(out) == contents(whole)
    assert list(read_results(out)["files"]) == list(read_results(whole)["files"])
    assert run(dataset, out) == ALL
    assert contents(out) == contents(whole)


def test_results_of_two_runs_are_not_taken_for_those_of_one(
    dataset: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, others = tmp_path / "out", {"z_mm": (500.0, 700.0)}
    run(dataset, out)
    interrupted(dataset, out, monkeypatch, at="removal_step", **others)
    with pytest.raises(InputError, match=r"segmented_brightness.zarr, segmented_variance.zarr: older than"):
        single_run.Results(out, dataset).load_segmented()
    interrupted(dataset, out, monkeypatch, at="score", **others)
    assert len(single_run.Results(out, dataset).load_segmented()) == len(METHODS)
    assert {"score.json", "report.html"} <= set(read_results(out)["files"])  # of the first run
    with pytest.raises(InputError, match=r"not finished: report.html, score.json, sections.zarr are"):
        verify(out)
    assert run(dataset, out, **others) == ALL
    assert verify(out) > 0


def test_what_other_options_made_is_made_anew(dataset: Dataset, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(dataset, out, z_mm=(540.0,), methods=METHODS[:1])
    # The range of depths is the recipe's, whatever sections are asked for.
    assert run(dataset, out, z_mm=(620.0,), methods=METHODS[:1]) == (long_steps.DEPTH_STEP,)
    assert run(dataset, out, z_mm=(620.0,), methods=METHODS[1:]) == (long_steps.DEPTH_STEP,)
    assert run(dataset, out, z_mm=(620.0,)) == ALL


def test_a_depth_map_of_another_method_or_light_is_made_anew(dataset: Dataset, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(dataset, out)
    assert run(dataset, out, depth_method="focus") == REMOVALS
    with pytest.raises(InputError, match="of another dataset or photon budget"):
        run(dataset.at_budget("full-light"), out, methods=None)


def test_what_is_damaged_is_made_anew(dataset: Dataset, whole: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(dataset, out)
    (chunk,) = (out / masks_name(METHODS[0]) / "in_focus" / "c").rglob("0/0/0")
    chunk.write_bytes(chunk.read_bytes()[:-1] + b"?")
    assert run(dataset, out) == (REMOVALS[1], long_steps.DEPTH_STEP)
    assert contents(out) == contents(whole)


def test_masks_of_a_single_step_are_not_taken_for_those_of_a_run(dataset: Dataset, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(dataset, out)
    other = pcii.segment(dataset.counts, z_mm=[540, 620], method="variance")
    with single_run.Results(out, dataset).writing() as results:
        results.save_segmented(Segmented(~other.in_focus, "brightness", other.sections))
    assert run(dataset, out) == (REMOVALS[1], long_steps.DEPTH_STEP)

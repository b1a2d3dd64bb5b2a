"""`pcii run` on datasets that no recipe made: with and without truth, counts only, radiance only."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pcii.app import single_run
from pcii.app.commands import app
from pcii.base import command_line
from pcii.base.errors import InputError
from pcii.removal.methods import segment
from pcii.store.dataset import open_dataset
from pcii.store.dataset_writer import save_dataset
from pcii.store.verification import verify
from pcii.types.camera_grid import CameraGrid
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts
from pcii.types.truth import Truth

GRID = CameraGrid(rows=2, cols=2, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.25, height=40, width=48)
LIGHT = np.random.default_rng(0).random((*GRID.shape_KLHW, 3)).astype(np.float32)
COUNTS = PhotonCounts.from_dense(np.random.default_rng(1).poisson(0.2, GRID.shape_KLHW), GRID, cfa="GRBG")
IDS = np.zeros((40, 48), np.int16)
IDS[10:30, 10:30] = 1
Z_MM = np.where(IDS > 0, 500.0, np.inf)


def run(*arguments: object) -> int:
    return command_line.run(app, [str(argument) for argument in arguments])


@pytest.mark.parametrize("has", ["counts", "counts views depth"])
def test_photon_counts_of_a_stranger_are_analysed(tmp_path: Path, capsys, has: str) -> None:
    truth = None
    if "depth" in has:  # of surfaces without names, as in benchmarks of depth
        truth = Truth(np.full((40, 48), 500.0), 0 * IDS, {})
    images = (COUNTS, Views(LIGHT, GRID)) if "views" in has else COUNTS
    texts: dict[str, Any] = {"title": "Mine", "licence": "CC-BY", "origin": "a lab"}
    dataset = save_dataset(tmp_path / "d", images, truth, z_mm=[500, 700], **texts)
    outcome = single_run.run(dataset, tmp_path / "out", None, methods=["brightness"])
    assert outcome.z_range_mm == (0.8 * 500, 1.25 * 700)
    page = (tmp_path / "out" / "report.html").read_text()
    assert all(
        text in page for text in ("<h1>Mine</h1>", "CC-BY", "a lab", dataset.manifest["identity"][:16])
    )
    capsys.readouterr()
    assert run("score", tmp_path / "d", tmp_path / "out") == 0
    assert ("has no truth" in capsys.readouterr().out) == (truth is None)
    assert verify(tmp_path / "out") > 5
    if "depth" in has:
        assert outcome.score.depth["hci"]["answered"] is not None


def test_radiance_alone_gives_sections_depth_and_a_report(tmp_path: Path, capsys) -> None:
    save_dataset(tmp_path / "d", Views(LIGHT, GRID), Truth(Z_MM, IDS, {1: "ball"}), z_mm=500)
    out = tmp_path / "out"
    assert run("run", tmp_path / "d", "-o", out) == 0
    assert "sections and depth only" in capsys.readouterr().out
    page = (out / "report.html").read_text()
    assert "without photon counts" in page
    assert "full light (Eq. 2)" in page
    assert "Figure 7" not in page
    assert "<h2>Depth" in page
    assert verify(out) > 3
    assert run("reconstruct", tmp_path / "d", "-o", tmp_path / "sections", "--z-mm", 600) == 0
    assert (tmp_path / "sections" / "section_600mm.png").is_file()


@pytest.mark.parametrize("command", [["segment"], ["run", "--method", "likelihood"]])
def test_what_needs_photons_says_so(tmp_path: Path, command, capsys) -> None:
    save_dataset(tmp_path / "d", Views(LIGHT, GRID), z_mm=500)
    assert run(command[0], tmp_path / "d", "-o", tmp_path / "out", *command[1:]) == 2
    assert "no photon counts; import the images with --photons N" in capsys.readouterr().err


def test_methods_for_photon_counts_say_what_to_do_with_images() -> None:
    views = Views(LIGHT, GRID)
    with pytest.raises(InputError, match="needs photon counts, and these are images; draw them with"):
        segment(views, 500)  # type: ignore[arg-type]


def test_results_of_one_strangers_dataset_are_not_taken_for_anothers(tmp_path: Path) -> None:
    save_dataset(tmp_path / "a", Views(LIGHT, GRID), z_mm=500)
    save_dataset(tmp_path / "b" / "a", Views(2 * LIGHT, GRID), z_mm=500)
    single_run.run(open_dataset(tmp_path / "a"), tmp_path / "out", None)
    with pytest.raises(InputError, match="the results of another dataset"):
        single_run.run(open_dataset(tmp_path / "b" / "a"), tmp_path / "out", None)

"""`pcii run` on datasets that no recipe made: with and without truth, counts only, radiance only."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pcii.app.commands import app
from pcii.base import command_line
from pcii.store import save_dataset, verify
from pcii.types import CameraGrid, PhotonCounts, Truth, Views

GRID = CameraGrid(rows=2, cols=2, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.25, height=40, width=48)
LIGHT = np.random.default_rng(0).random((*GRID.shape_KLHW, 3)).astype(np.float32)
COUNTS = PhotonCounts.from_dense(np.random.default_rng(1).poisson(0.2, GRID.shape_KLHW), GRID, cfa="GRBG")
IDS = np.zeros((40, 48), np.int16)


def run(*arguments: object) -> int:
    return command_line.run(app, [str(argument) for argument in arguments])


def test_photon_counts_of_a_stranger_are_analysed(tmp_path: Path, capsys) -> None:
    texts: dict[str, Any] = {"title": "Mine", "licence": "CC-BY", "origin": "a lab"}
    dataset = save_dataset(tmp_path / "d", COUNTS, z_mm=[500, 700], **texts)
    fast = ["--method", "brightness", "--depth-method", "variance-sweep"]
    assert run("run", tmp_path / "d", "-o", tmp_path / "out", *fast) == 0
    page = (tmp_path / "out" / "report.html").read_text()
    for text in ("<h1>Mine</h1>", "CC-BY", "a lab", dataset.manifest["identity"][:16]):
        assert text in page
    capsys.readouterr()
    assert run("score", tmp_path / "d", tmp_path / "out") == 0
    assert "has no truth" in capsys.readouterr().out
    assert verify(tmp_path / "out") > 5


def test_radiance_alone_gives_sections_depth_and_a_report(tmp_path: Path, capsys) -> None:
    # Surfaces without names, as in benchmarks of depth.
    save_dataset(tmp_path / "d", Views(LIGHT, GRID), Truth(np.full((40, 48), 500.0), 0 * IDS, {}), z_mm=500)
    assert run("run", tmp_path / "d", "-o", tmp_path / "out") == 0
    assert "sections and depth only" in capsys.readouterr().out
    assert verify(tmp_path / "out") > 3


@pytest.mark.parametrize("command", [["segment"], ["run", "--method", "posterior"]])
def test_what_needs_photons_says_so(tmp_path: Path, command, capsys) -> None:
    save_dataset(tmp_path / "d", Views(LIGHT, GRID), z_mm=500)
    assert run(command[0], tmp_path / "d", "-o", tmp_path / "out", *command[1:]) == 2
    assert "no photon counts; import the images with --photons N" in capsys.readouterr().err


def test_depths_that_nothing_suggests_are_named_by_options(tmp_path: Path, capsys) -> None:
    save_dataset(tmp_path / "d", COUNTS)
    out = tmp_path / "out"
    assert run("segment", tmp_path / "d", "-o", out) == 2
    assert "suggests no depths; name depths with --z-mm" in capsys.readouterr().err
    assert run("depth", tmp_path / "d", "-o", out) == 2
    assert "or a range with --z-range-mm" in capsys.readouterr().err
    assert run("depth", tmp_path / "d", "-o", out, "--z-range-mm", 450, 700) == 0
    assert "depth.png: 450 mm is yellow, 700 mm violet" in capsys.readouterr().out
    fast = ["--method", "brightness", "--depth-method", "variance-sweep"]
    found = ["run", tmp_path / "d", "-o", out, "--z-range-mm", 400, 900, *fast]
    assert run(*found) == 2
    assert "no depth is found in the range; name depths with --z-mm" in capsys.readouterr().err
    texture = np.random.default_rng(2).gamma(0.5, 40, (40, 48))  # 2 px from view to view are 500 mm
    wall = [[np.roll(texture, (-2 * k, -2 * l), (0, 1)) for l in range(2)] for k in range(2)]
    photons = np.random.default_rng(3).poisson(wall)
    save_dataset(tmp_path / "wall", PhotonCounts.from_dense(photons, GRID))
    assert run("run", tmp_path / "wall", "-o", tmp_path / "seen", *found[4:-2]) == 0
    (depths,) = re.findall(r"the depth map has most surfaces at ([\d., ]+) mm;", capsys.readouterr().out)
    assert min(abs(float(text) - 500) for text in depths.split(",")) < 30
    command = ["run", tmp_path / "d", "-o", out, "--z-range-mm", 400, 900, "--z-mm", 600]
    assert run(*command, *fast) == 0
    assert run("depth", tmp_path / "d", "-o", out, "--z-range-mm", 700, 400) == 2
    assert "near must be less than far" in capsys.readouterr().err

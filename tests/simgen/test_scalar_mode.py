"""The renderer without a compiled backend: light, photons and truth are what they are with one."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from lit_scenes import SCALAR

HERE = Path(__file__).parent
TESTS = [
    "test_lamps.py::test_a_points_light_falls_off_with_the_square_and_the_cosine",
    "test_lamps.py::test_a_spot_is_bright_in_its_beam_and_dark_beyond_its_cutoff",
    "test_lamps.py::test_what_is_not_visible_lights_things_before_darkness[uniform]",
    "truth/test_truth_file.py::test_coverage_of_a_card_from_a_camera_off_the_centre",
]
"""Tests of light, photons and truth that are run once more."""


@pytest.mark.renders
@pytest.mark.skipif(SCALAR, reason="this is scalar mode")
def test_scalar_mode_gives_the_same() -> None:
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *TESTS],
        cwd=HERE,
        env=os.environ | {"SIMGEN_BACKEND": "scalar"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout[-3000:]

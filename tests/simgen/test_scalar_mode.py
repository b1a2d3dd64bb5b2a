"""The renderer without a compiled backend: light, photons and truth are what they are with one."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from lit_views import SCALAR

HERE = Path(__file__).parent
TESTS = [
    "test_lamps.py::test_a_points_light_falls_off_with_the_square_and_the_cosine",
    "test_lamps.py::test_a_spot_is_bright_in_its_beam_and_dark_beyond_its_cutoff",
    "test_truth_passes.py::test_coverage_is_the_area_that_the_object_has_of_the_pixel",
]
MORE_TESTS = [
    "test_furnace.py::test_thinned_photons_see_nothing_in_the_furnace",
    "test_lamps.py::test_parallel_light_is_even_and_throws_a_shadow_along_its_direction",
    "test_truth_passes.py::test_normals_are_the_surfaces_own_and_face_the_camera",
    "test_truth_passes.py::test_visibility_is_what_a_loop_over_cameras_and_shapes_counts",
]
"""Tests of light, photons and truth that are run once more."""


@pytest.mark.renders
@pytest.mark.skipif(SCALAR, reason="this is scalar mode")
@pytest.mark.parametrize(
    "tests", [TESTS, pytest.param(MORE_TESTS, marks=pytest.mark.slow)], ids=["few", "more"]
)
def test_scalar_mode_gives_the_same(tests: list[str]) -> None:
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *tests],
        cwd=HERE,
        env=os.environ | {"SIMGEN_BACKEND": "scalar"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout[-3000:]

"""The same numbers to the bit for any number of threads and in any run."""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pcii

ROOT = Path(__file__).resolve().parents[2]
GRID = pcii.CameraGrid(rows=3, cols=4, pitch_mm=(5.0, 4.0), focal_mm=50.0, pixel_mm=0.25, height=37, width=41)

MODES: list[dict[str, Any]] = [{"variance": True}, {"subpixel": 2}]


def results(grid: pcii.CameraGrid = GRID) -> dict[str, str]:
    """Hashes of what every compiled loop takes part in."""
    rng = np.random.default_rng(0)
    film = rng.poisson(0.4, grid.shape_KLHW)
    dense = pcii.PhotonCounts.from_dense(film, grid, cfa="GRBG")
    few = pcii.limit_photons(pcii.Views(rng.random((*grid.shape_KLHW, 3)), grid), 50, seed=1, cfa="GRBG")
    made: dict[str, np.ndarray] = {"photons": np.stack([few.events.i, few.events.j])}
    for name, counts in (("dense", dense), ("sparse", few)):
        sections = pcii.reconstruct(counts, [400, 500], variance=True)
        assert sections.variance is not None
        made |= {f"{name} 1": sections.counts, f"{name} variance": sections.variance}
        made[f"{name} 2"] = pcii.reconstruct(counts, [400, 500], subpixel=2).counts
        for method in pcii.removal_methods():
            made[f"{name} {method}"] = pcii.segment(counts, [400, 500], method=method).in_focus
        for method in pcii.depth_methods(counts):
            depth = pcii.estimate_depth(counts, (300, 900), method=method)
            made |= {f"{name} {method} z": depth.z_mm, f"{name} {method} sure": depth.confidence}
    for dtype in (np.float32, np.float64):
        views = pcii.Views(rng.normal(5, 1, (*grid.shape_KLHW, 3)).astype(dtype), grid)
        for options in MODES:
            sections = pcii.reconstruct(views, [400, 500], **options)
            made[f"{np.dtype(dtype)} {options}"] = sections.counts
            if sections.variance is not None:
                made[f"{np.dtype(dtype)} {options} variance"] = sections.variance
        for method in pcii.depth_methods(views):
            made[f"{np.dtype(dtype)} {method}"] = pcii.estimate_depth(views, (300, 900), method=method).z_mm
    made["demosaiced"] = pcii.demosaic(film[0, 0], cfa="GRBG")
    return {name: hashlib.sha256(np.ascontiguousarray(x).tobytes()).hexdigest() for name, x in made.items()}


def results_of(threads: int, height: int) -> dict[str, str]:
    """The hashes in a process of its own, which has four threads and uses so many."""
    script = (
        "import json, sys\n"
        "from dataclasses import replace\n"
        "from pcii.base.compiled_loops import threads, use_threads\n"
        "use_threads(int(sys.argv[1]))\n"
        "assert threads() == int(sys.argv[1])\n"
        "from test_repeatability import GRID, results\n"
        "print(json.dumps(results(replace(GRID, height=int(sys.argv[2])))))\n"
    )
    folders = [ROOT, *(ROOT / "tests" / name for name in (".", "pcii", "stress"))]
    environment = os.environ | {"NUMBA_NUM_THREADS": "4", "PYTHONPATH": os.pathsep.join(map(str, folders))}
    done = subprocess.run(
        [sys.executable, "-W", "error::RuntimeWarning", "-c", script, str(threads), str(height)],
        capture_output=True,
        text=True,
        env=environment,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_one_thread_and_another_run_give_the_same_bits() -> None:
    assert results_of(1, GRID.height) == results()


@pytest.mark.stress
@pytest.mark.parametrize("threads", [1, 2, 3, 4])
def test_any_number_of_threads_gives_the_same_bits_of_larger_films(threads: int) -> None:
    """Films of 300 rows have many bands of rows, which are shared out unevenly."""
    assert results_of(threads, 300) == results_of(4, 300)

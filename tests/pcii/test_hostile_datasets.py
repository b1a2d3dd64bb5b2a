"""Datasets that strangers made to do harm are refused in one sentence, soon, and in little memory."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from stored_datasets import make_dataset

HERE = Path(__file__).resolve().parent


@pytest.mark.parametrize(
    ("number", "seed"), [(60, 0), pytest.param(5000, 1, marks=pytest.mark.slow)], ids=["some", "many"]
)
def test_hostile_datasets_are_refused_or_read(tmp_path: Path, number: int, seed: int) -> None:
    whole = make_dataset(tmp_path / "whole")
    command = [sys.executable, str(HERE / "hostile_datasets.py"), str(whole), str(tmp_path / "scratch")]
    environment = {"PYTHONPATH": str(HERE.parents[1]), "PATH": ""}
    done = subprocess.run(
        [*command, str(number), str(seed)],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
        timeout=60 + 2 * number,  # a hang, not a slow machine: each is a few kB
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout.splitlines()[-1])  # OpenEXR prints its warnings before
    assert result["faults"] == []
    assert result["refused"] > number / 2
    assert result["memory_mb"] < 1024

"""Every example runs without an argument, and says something."""

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parent.parent / "examples").glob("*.py"))


def _case(example: Path) -> object:
    marks = [pytest.mark.renders] if "import simgen" in example.read_text() else []
    return pytest.param(example, id=example.stem, marks=marks)


@pytest.mark.parametrize("example", [_case(example) for example in EXAMPLES])
def test_an_example_runs(example: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(example)], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) >= 2

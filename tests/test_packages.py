"""Wheel and sdist work where they are installed, without and with the renderer."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.slow
@pytest.mark.renders
def test_the_packages_work_in_a_clean_environment(tmp_path: Path) -> None:
    script = ROOT / "packaging" / "check_packages.py"
    done = subprocess.run(
        [sys.executable, str(script), str(tmp_path / "trial")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "analysis installs" in done.stdout

"""Whole processes: how long they take, and how much memory at most."""

import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

POLL_S = 0.02


@dataclass(frozen=True)
class Finished:
    """Wall seconds, peak resident memory in MB (None where the system does not tell), standard output."""

    seconds: float
    peak_mb: float | None
    output: str


def run_process(command: Sequence[str]) -> Finished:
    """Run a command to its end; `CalledProcessError` with its messages if it fails.

    The peak is of the process itself. The system's count of children would not do: it hands on the peak of
    the process that started them.
    """
    start, peak = time.perf_counter(), None
    # Files, since a pipe that nobody reads stops who writes much into it.
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as messages:
        with subprocess.Popen(command, stdout=output, stderr=messages) as process:
            while process.poll() is None:
                peak = _peak_mb(process.pid) or peak
                time.sleep(POLL_S)
            seconds = time.perf_counter() - start
        output.seek(0)
        messages.seek(0)
        if process.returncode:
            fault = process.returncode, list(command), output.read(), messages.read()
            raise subprocess.CalledProcessError(*fault)
        return Finished(seconds, peak, output.read())


def _peak_mb(pid: int) -> float | None:
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return None
    return next(
        (int(line.split()[1]) / 1024 for line in status.splitlines() if line.startswith("VmHWM")), None
    )

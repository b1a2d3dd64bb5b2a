"""A process that runs `simgen` commands when it is told to, all imports done, and says how that went.

    python writers.py LOG

Reads command lines as JSON, one a line. After each it prints a line: the exit code, the seconds, what it said
on standard error. Adds a line to LOG for each dataset that it begins to make. Scenes take a second
longer to load than they need, as large ones do.
"""

import contextlib
import io
import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

LOAD_S = 1.2


class Outcome(NamedTuple):
    """How a command ended."""

    code: int
    seconds: float
    error: str


class Writer:
    """Such a process; it has done its imports when this returns."""

    def __init__(self, log: Path) -> None:
        command = [sys.executable, __file__, str(log)]
        pipes: Any = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        self.process = subprocess.Popen(command, text=True, **pipes)
        assert self._line() == "ready"

    def start(self, *arguments: str) -> None:
        """Begin a command."""
        assert self.process.stdin is not None
        print(json.dumps(arguments), file=self.process.stdin, flush=True)

    def end(self) -> Outcome:
        """Wait for the end of the command."""
        return Outcome(*json.loads(self._line()))

    def close(self) -> None:
        """End the process."""
        self.process.communicate()

    def _line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()


def main(log: Path) -> None:
    from pcii.base import command_line
    from simgen.app import commands
    from simgen.dataset import dataset_collection, generation, prepared
    from simgen.renderer import backend

    assert dataset_collection
    backend.load()
    work, load = generation._write_products, prepared.Prepared.render_scene

    def noted(*given: Any) -> Any:
        with log.open("a") as file:
            print(given[4], file=file, flush=True)  # the folder
        return work(*given)

    def slow(self: prepared.Prepared) -> Any:
        time.sleep(LOAD_S)
        return load(self)

    generation._write_products, prepared.Prepared.render_scene = noted, slow
    print("ready", flush=True)
    for line in sys.stdin:
        start, said = time.monotonic(), io.StringIO()
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
            code = command_line.run(commands.app, json.loads(line))
        print(json.dumps([code, time.monotonic() - start, said.getvalue()]), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))

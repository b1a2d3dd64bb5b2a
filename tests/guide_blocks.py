"""The blocks of the Markdown pages: what they hold, and how they are run.

A block of Python runs, in the order of its page. So does a block of `sh`; commands in blocks without a
language are for reading, and are only parsed. A block that begins with a comment such as `# my_methods.py` is
that file, and one that begins with `# at the end of mine.toml` is added to it.
"""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcii.app import commands as pcii_commands
from pcii.base import command_line
from simgen.app import commands as simgen_commands

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("packaging/*.md"), *ROOT.glob("docs/**/*.md")])
APPS = {"simgen": simgen_commands.app, "pcii": pcii_commands.app}
FENCED = re.compile(r"^( *)```(\S*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"\A(?:#:.*\n)?# (at the end of )?([\w./-]+\.(?:py|toml))$", re.MULTILINE)
SHELL_SIGNS = set("();<>|&")


@dataclass(frozen=True)
class Block:
    """What stands between two fences."""

    language: str
    text: str

    def commands(self) -> Iterator[str]:
        """Its command lines without prompts, a continued one as one line; none of Python and other text."""
        if self.language in ("", "sh"):
            for line in self.text.replace("\\\n", " ").splitlines():
                yield line.removeprefix("$ ")


def blocks(page: Path) -> list[Block]:
    """All blocks of a page, from top to bottom."""
    return [Block(language, text) for _, language, text in FENCED.findall(page.read_text(encoding="utf-8"))]


def words(line: str) -> list[str]:
    """The words of a command line; signs of the shell are words, comments are left out."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
    lexer.whitespace_split = True
    return list(lexer)


def run_page(page: Path) -> dict[str, Any]:
    """Run a page in the working folder, and give the names that its Python has defined."""
    names: dict[str, Any] = {"__name__": "guide"}
    for block in blocks(page):
        file = FILE.match(block.text)
        if file:
            path = Path(file[2])
            path.parent.mkdir(parents=True, exist_ok=True)
            before = path.read_text(encoding="utf-8") if file[1] else ""
            path.write_text(before + block.text, encoding="utf-8")
        elif block.language == "python":
            exec(compile(block.text, page.name, "exec"), names)
        elif block.language == "sh":
            for line in block.commands():
                _run_line(line)
    return names


def _run_line(line: str) -> None:
    """AssertionError if the command fails. Where the shell has no part in it no process is started."""
    program, *arguments = words(line)
    if program in APPS and not SHELL_SIGNS & {word[0] for word in arguments}:
        assert command_line.run(APPS[program], arguments) == 0, line
    else:
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        subprocess.run(["bash", "-c", line], check=True, env=os.environ | {"PATH": path})

"""Commands, options, TOML and links that the pages name exist."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from cyclopts import CycloptsError
from guide_blocks import APPS, PAGES, SHELL_SIGNS, blocks, words

INLINE = re.compile(r"(?<!`)`((?:simgen|pcii) [^`]+)`(?!`)")
LINK = re.compile(r"\]\((?!https?://)([^)#\s]+)")
COMMON = {"--help"}
"""Options that every command has, and that its own parser does not know."""
by_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.name))


def commands(line: str) -> Iterator[list[str]]:
    """The commands of a line, of which `simgen` and `pcii` alone are given, without the shell's signs."""
    part: list[str] = []
    for word in [*words(line), ";"]:
        if set(word) <= SHELL_SIGNS:
            if part:
                yield part
            part = []
        else:
            part.append(word.removeprefix(".venv/bin/"))


@by_page
def test_commands_of_blocks_are_understood(page: Path) -> None:
    for block in blocks(page):
        for line in block.commands():
            if not re.match(r"(\.venv/bin/)?(simgen|pcii) ", line):
                continue
            for program, *arguments in commands(line):
                if program in APPS:
                    own = [word for word in arguments if word not in COMMON]
                    try:
                        APPS[program].parse_args(own, exit_on_error=False, print_error=False)
                    except CycloptsError as fault:
                        pytest.fail(f"{page.name}: {line.strip()}: {fault}")


@by_page
def test_commands_and_options_of_sentences_exist(page: Path) -> None:
    for text in INLINE.findall(page.read_text(encoding="utf-8")):
        program, command, *rest = text.split()
        app = APPS[program]
        if command.startswith("-"):
            continue
        assert command in app, f"{page.name}: {text}"
        own = app[command]
        if own.default_command is None and rest:  # a group of commands, such as `simgen benchmark make`
            assert rest[0] in own, f"{page.name}: {text}"
            own = own[rest.pop(0)]
        options = [] if own.default_command is None else own.assemble_argument_collection()
        known = {name for each in options for name in each.names} | COMMON
        for word in rest:
            if re.match(r"--?[a-z]", word):
                assert word.split("=")[0] in known, f"{page.name}: {text}"


@by_page
def test_tables_are_toml(page: Path) -> None:
    for block in blocks(page):
        if block.language == "toml":
            keys = re.findall(r"^(\w+) = ", block.text, re.MULTILINE)
            alternatives = len(keys) > 1 == len({*keys})
            for table in block.text.splitlines() if alternatives else [block.text]:
                tomllib.loads(table)


@by_page
def test_links_lead_to_files(page: Path) -> None:
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), f"{page.name}: {target}"

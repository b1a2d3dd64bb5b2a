"""Commands as a user types them, within the process of the tests."""

from pcii.app import commands as pcii_commands
from pcii.base import command_line
from simgen.app import commands as simgen_commands


def run_pcii(*arguments: object) -> int:
    """Its exit code."""
    return command_line.run(pcii_commands.app, [str(argument) for argument in arguments])


def run_simgen(*arguments: object) -> int:
    return command_line.run(simgen_commands.app, [str(argument) for argument in arguments])

"""The exception that is raised for invalid input."""


class InputError(ValueError):
    """Invalid input, described in one sentence that names the argument, field or file and what is expected.

    The commands print the sentence and exit with code 2.
    """


class BusyError(InputError):
    """Another process is at this work."""

"""Exceptions whose sentence is all that a command prints of them."""


class InputError(ValueError):
    """Invalid input, described in one sentence that names the argument, field or file and what is expected.

    Where a file has several faults the sentence is of the first, and notes (`add_note`) name the others. The
    commands print both and exit with code 2.
    """


class WorkerLostError(RuntimeError):
    """A process that did a part of the work has died, or a cluster is out of reach."""

"""The one exception that means: what you gave us cannot be used, and here is why."""


class InputError(ValueError):
    """Bad input, told in one sentence that names the argument, field or file and what would be right.

    The commands print the sentence and leave with exit code 2.
    """

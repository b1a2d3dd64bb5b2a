"""How many random cases a property is tried with: its own number, or that of the profile if it is larger."""

from hypothesis import settings


def at_least(number: int) -> settings:
    """Settings of so many cases, or of 10 000 with `--hypothesis-profile=stress`."""
    return settings(max_examples=max(number, settings().max_examples), deadline=None)

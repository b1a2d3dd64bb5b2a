"""Numbers of two digits for messages, and by how much they may be off."""

ROUNDING = 1.05
"""Two digits are off by up to 5 %: what is said to fit, divided by this before it is rounded, does so."""


def two_digits(value: float) -> str:
    """A number with two digits.

    >>> two_digits(1234.0), two_digits(0.0456)
    ('1200', '0.046')
    """
    return f"{float(f'{value:.2g}'):g}"

"""Names of views in files: camera (k, l) with as many digits as the grid needs, so that they sort."""


def number_width(count: int, least: int) -> int:
    """Digits of the largest of the numbers 0 .. `count` - 1, at least `least`.

    >>> number_width(100, 2), number_width(101, 2), number_width(81, 3)
    (2, 3, 3)
    """
    return max(least, len(str(count - 1)))

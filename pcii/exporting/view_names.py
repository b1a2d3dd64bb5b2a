"""Names of views in files: camera (k, l) with as many digits as the grid needs, so that they sort."""

from pcii.core.camera_grid import CameraGrid


def number_width(count: int, least: int) -> int:
    """Digits of the largest of the numbers 0 .. `count` - 1, at least `least`.

    >>> number_width(100, 2), number_width(101, 2), number_width(81, 3)
    (2, 3, 3)
    """
    return max(least, len(str(count - 1)))


def row_and_column(grid: CameraGrid, k: int, l: int) -> str:
    """Row and column of a camera, "03_04"."""
    width = number_width(max(grid.rows, grid.cols), 2)
    return f"{k:0{width}d}_{l:0{width}d}"

"""Compiled loops of Laroche-Prescott demosaicing."""

import numpy as np

from pcii.base.compiled_loops import helper, shared


@shared(lambda green, *_: len(green))
def interpolate_green(first: int, last: int, green: np.ndarray, raw: np.ndarray, cells: np.ndarray) -> None:
    """Green at every pixel of a mosaic (H, W): Eqs. 4 and 5 of Muniraj et al. 2017.

    `cells` (2, 2) are the colours of the Bayer cells. The image is continued by reflection about its border
    pixels.
    """
    height, width = raw.shape
    for i in range(first, last):
        row, above, below = raw[i], raw[_reflected(i - 1, height)], raw[_reflected(i + 1, height)]
        far_above, far_below = raw[_reflected(i - 2, height)], raw[_reflected(i + 2, height)]
        for parity in range(2):
            if cells[i % 2, parity] == 1:
                for j in range(parity, width, 2):
                    green[i, j] = row[j]
                continue
            for j in range(parity, width, 2):
                if 2 <= j < width - 2:
                    left, right, far_left, far_right = row[j - 1], row[j + 1], row[j - 2], row[j + 2]
                else:
                    left, right = row[_reflected(j - 1, width)], row[_reflected(j + 1, width)]
                    far_left, far_right = row[_reflected(j - 2, width)], row[_reflected(j + 2, width)]
                alpha = abs((far_left + far_right) / 2 - row[j])
                beta = abs((far_above[j] + far_below[j]) / 2 - row[j])
                if alpha < beta:
                    green[i, j] = (left + right) / 2
                elif alpha > beta:
                    green[i, j] = (above[j] + below[j]) / 2
                else:  # rare in photographs, but usual for photon counts, most of which are 0
                    green[i, j] = (above[j] + left + right + below[j]) / 4


@shared(lambda image, *_: len(image))
def interpolate_chroma(
    first: int, last: int, image: np.ndarray, green: np.ndarray, raw: np.ndarray, cells: np.ndarray
) -> None:
    """Colours (H, W, 3) from a mosaic and its green: Eq. 6, differences from green at their own sites."""
    height, width = raw.shape
    for i in range(first, last):
        up, down = _reflected(i - 1, height), _reflected(i + 1, height)
        for parity in range(2):
            colour, row_colour = cells[i % 2, parity], cells[i % 2, 1 - parity]
            column_colour = cells[1 - i % 2, parity]
            for j in range(parity, width, 2):
                left, right = j - 1, j + 1
                if j == 0 or j == width - 1:
                    left, right = _reflected(left, width), _reflected(right, width)
                green_here = green[i, j]
                image[i, j, 1] = green_here
                if colour == 1:
                    horizontal = (raw[i, left] - green[i, left]) + (raw[i, right] - green[i, right])
                    vertical = (raw[up, j] - green[up, j]) + (raw[down, j] - green[down, j])
                    image[i, j, row_colour] = horizontal / 2 + green_here
                    image[i, j, column_colour] = vertical / 2 + green_here
                else:
                    above = (raw[up, left] - green[up, left]) + (raw[up, right] - green[up, right])
                    diagonal = above + (raw[down, left] - green[down, left])
                    diagonal += raw[down, right] - green[down, right]
                    image[i, j, colour] = raw[i, j]
                    image[i, j, 2 - colour] = diagonal / 4 + green_here


@helper
def _reflected(index: int, size: int) -> int:
    """The index inside 0 .. size-1 that stands for this one under reflection about the border pixels."""
    while index < 0 or index >= size:
        index = -index if index < 0 else 2 * (size - 1) - index
    return index

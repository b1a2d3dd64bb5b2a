"""The coarse grid on which evidence of focus is kept."""

CELL_PX = 4
"""Cells of 4 x 4 pixels: the windows over which evidence is summed are larger."""

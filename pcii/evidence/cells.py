"""The coarse grid in which halves of the cameras are compared."""

CELL_PX = 4
"""Cells of 4 x 4 pixels, the smallest blocks that are compared; small films have smaller ones."""
BLOCK_PX = 2
"""Voxels of 2 x 2 pixels, each of which every Bayer colour covers equally for any shifts.

Single pixels are not covered equally: at depths where all shifts are even a colour falls on every fourth
voxel only, each of which holds four times as many photons, and textured regions would be assigned such
depths."""

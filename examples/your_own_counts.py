"""Sections of counts that you have: an array (K, L, H, W) of whole numbers, here of a point at 600 mm."""

import numpy as np

import pcii

grid = pcii.CameraGrid(rows=5, cols=5, pitch_mm=(6.0, 6.0), focal_mm=50.0, pixel_mm=0.1, height=65, width=65)
stack = np.random.default_rng(0).poisson(0.01, grid.shape_KLHW)
disparity_px = grid.focal_mm * grid.pitch_mm[0] / (600.0 * grid.pixel_mm)
for k in range(5):
    for l in range(5):
        # A camera further right sees the point further left, one further down further up.
        i, j = (round(32 - (n - 2) * disparity_px) for n in (k, l))
        stack[k, l, i, j] += 1

counts = pcii.PhotonCounts.from_dense(stack, grid, cfa=None)
sections = pcii.reconstruct(counts, z_mm=[500, 600, 700])
for z_mm, photons in zip(sections.z_mm, sections.counts, strict=True):
    print(f"{z_mm:g} mm: {photons.max()} photons at the brightest voxel")

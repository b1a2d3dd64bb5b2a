"""Map the depth of every pixel of the virtual centre, and say how far off it is."""

import numpy as np

import pcii
import simgen

grid = pcii.CameraGrid(
    rows=6, cols=6, pitch_mm=(8.0, 8.0), focal_mm=50.0, pixel_mm=0.14, height=256, width=256
)
counts, truth = simgen.draw_photons(simgen.load_scene("natural_balls"), grid, budget=10_000, seed=1)
depth = pcii.estimate_depth(counts, z_range_mm=(450, 750))
print(f"{np.isfinite(depth.z_mm).mean():.1%} of the pixels have an answer")
errors = pcii.score(None, depth, truth, grid=grid).depth
print(f"median error {errors['median_mm']:.1f} mm, {errors['bad_1px']:.1%} off by more than 1 px")

"""Map the depth of every pixel of the virtual centre, and say how far off it is. Needs no renderer."""

import numpy as np

import pcii

dataset = pcii.sample()
depth = pcii.estimate_depth(dataset.counts, z_range_mm=(450, 750))
print(f"{np.isfinite(depth.z_mm).mean():.1%} of the pixels have an answer")
errors = pcii.score(None, depth, dataset.truth, grid=dataset.grid).depth
print(f"median error {errors['median_mm']:.1f} mm, {errors['bad_1px']:.1%} off by more than 1 px")

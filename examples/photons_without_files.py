"""Draw photons of a scene and reconstruct it, without a file."""

import pcii
import simgen

grid = pcii.CameraGrid(
    rows=6, cols=6, pitch_mm=(8.0, 8.0), focal_mm=50.0, pixel_mm=0.14, height=256, width=256
)
scene = simgen.load_scene("two_objects")
counts, truth = simgen.draw_photons(scene, grid, budget=1000, cfa="GRBG", seed=1)
print(counts)
print(truth)

sections = pcii.reconstruct(counts, z_mm=[540, 620])
for z_mm, counted in zip(sections.z_mm, sections.counts, strict=True):
    print(f"{z_mm:g} mm: {counted.sum()} photons, {counted.max()} at the brightest voxel")

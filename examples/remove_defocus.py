"""Remove what is out of focus with two methods, and compare them with the truth."""

import pcii
import simgen

grid = pcii.CameraGrid(
    rows=6, cols=6, pitch_mm=(8.0, 8.0), focal_mm=50.0, pixel_mm=0.14, height=256, width=256
)
counts, truth = simgen.draw_photons(simgen.load_scene("two_objects"), grid, budget=4000, seed=1)
for method in ("three-step", "likelihood"):
    focus = pcii.segment(counts, z_mm=[540, 620], method=method)
    for row in pcii.score(focus, None, truth).planes:
        if row["truth"] == "object":
            print(f"{method}, {row['z_mm']:g} mm: {row['object']}, IoU {row['iou']:.3f}")

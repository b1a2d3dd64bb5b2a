"""Remove what is out of focus with two methods, and compare them with the truth. Needs no renderer."""

import pcii

dataset = pcii.sample()
for method in ("three-step", "posterior"):
    focus = pcii.segment(dataset.counts, z_mm=[540, 620], method=method)
    for row in pcii.score(focus, None, dataset.truth).planes:
        if row["truth"] == "object":
            print(f"{method}, {row['z_mm']:g} mm: {row['object']}, IoU {row['iou']:.3f}")

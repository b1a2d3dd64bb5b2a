"""Removal of defocused points: methods by name, simple ones, and those of other packages.

likelihood/     Removal by likelihood: regions, duels of depths, opaque layers, outlines.
methods         Removal of defocused points: which points of each section are in focus there.
plugins         Removal methods that other packages bring: entry points of the group `pcii.methods`.
simple_methods  Removal as textbooks would do it: by brightness, by variance, by sharpness.
three_step/     The paper's removal in three steps: threshold, boundary, entropy (Eqs. 7-9).
"""

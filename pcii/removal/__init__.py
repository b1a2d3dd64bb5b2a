"""Removal of defocused points: methods by name, and those of other packages.

likelihood/     Removal by likelihood: regions, opaque layers, outlines.
methods         Removal methods by name: which points of each section are in focus.
plugins         Removal methods registered by other packages: entry points of the group `pcii.methods`.
posterior_masks Removal by the posterior probability of depth.
three_step/     The paper's removal in three steps: threshold, boundary, entropy (Eqs. 7-9).
"""

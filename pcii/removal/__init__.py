"""Removal of defocused points: methods by name, and those of other packages.

methods         Removal methods by name: which points of each section are in focus.
plugins         Removal methods registered by other packages: entry points of the group `pcii.methods`.
posterior_masks Removal by the network of depth.
three_step/     The paper's removal in three steps: threshold, boundary, entropy (Eqs. 7-9).
"""

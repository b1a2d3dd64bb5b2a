"""Textbook methods of depth and of removal to compare others with, loaded when asked for by name.

simple_removals Removal by brightness, by variance, by sharpness.
textbook_depth  Depth by plane sweeps, by variance and by likelihood, and by the structure tensor.
"""

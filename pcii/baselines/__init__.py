"""Textbook methods of depth and of removal to compare others with, loaded when asked for by name.

epipolar_slopes Depth from the slope of lines in epipolar images, by the structure tensor.
plane_sweeps    Depth by plane sweeps with windows of one size: by variance, by likelihood.
simple_removals Removal by brightness, by variance, by sharpness.
"""

"""Estimators of depth.

depth_map  Depth maps from the focus evidence of planes: a depth and its posterior probability for each
           pixel.
"""

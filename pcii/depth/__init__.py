"""Estimators of depth.

depth_map  Depth maps: where does the light say that the surface is, and how sure is that?
"""

"""Scenes that Python draws: functions of a random stream, of ten kinds, judged on what nobody arranged.

Each is an entry point of the group `simgen.scenes`, as scenes of other packages are, and a scene is the same
for all time. Depths, sizes, shapes, colours, textures and lights differ.
"""

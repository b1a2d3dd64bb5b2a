"""The `simgen` command.

commands           The `simgen` command.
draw_files         One draw of a distribution of scenes, written as a scene of its own.
library            What the commands do, as functions: scenes and recipes by name, datasets, pictures.
photons_in_memory  Photon counts of a scene and its truth without a file.
scene_commands     Commands about scenes: list, describe, check, look at, draw.
"""

"""The `simgen` command.

commands           The `simgen` command.
library            What the commands do, as functions: scenes and recipes by name, datasets, pictures.
photons_in_memory  Photon counts of a scene and its truth without a file.
"""

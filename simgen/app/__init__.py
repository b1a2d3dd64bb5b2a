"""The `simgen` command, and what it does as functions.

commands         The `simgen` command: datasets, and what they are made with.
in_memory        Photon counts of a scene with its truth, and its views, without a file.
library          What the commands do, as functions: scenes and recipes by name, datasets, pictures.
pictures         Pictures: what the virtual centre sees of a scene, and a contact sheet of a dataset.
scene_commands   Commands about scenes and recipes: list, write, check, look at.
starting_points  Scenes and recipes to start from: lists of them, and new ones as commented files.
templates/       What they are written from.
"""

"""The `simgen` command, and what it does as functions.

commands         The `simgen` command: datasets, and what they are made with.
in_memory        Photon counts of a scene with its truth, and its views, without a file.
library          What the commands do, as functions: scenes and recipes by name, datasets, pictures.
pictures         Pictures of a scene and of a dataset: what the virtual centre camera sees, and a contact
                 sheet.
scene_commands   Commands about scenes and recipes: list, write, check, look at.
starting_points  Scenes and recipes to start from: what ships or stands in the working directory, and new ones
                 as commented files that work as they are written.
templates/       What they are written from.
"""

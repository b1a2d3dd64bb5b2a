"""The `simgen` command.

authoring_commands   Commands that write scenes and recipes: to start from, one draw of many, from another
                     program's file.
benchmark_commands   The command `simgen benchmark`.
commands             The `simgen` command.
listings             Lists of the scenes and recipes that ship or stand in the working directory.
library              What the commands do, as functions: scenes and recipes by name, datasets, pictures.
scene_commands       Commands about scenes and recipes: list, describe, check, look at.
starting_points      Scenes and recipes to start from: commented files that work as they are written.
templates/           What they are written from.
without_files        Photon counts, truth and views of a scene without a file.
"""

"""The `simgen` command.

authoring_commands   Commands that write scenes and recipes: to start from, or from another program's file.
benchmark_commands   The command `simgen benchmark`.
commands             The `simgen` command.
contact_sheet        A contact sheet of a finished dataset: its truth, its photons and its full-light images
                     on one page.
listings             Lists of the scenes and recipes that ship or stand in the working directory.
library              What the commands do, as functions: scenes and recipes by name, datasets, pictures.
picture_parts        Parts of the pictures of `preview` and `sheet`: where to look, depth and objects, and
                     the file.
preview_picture      A quick look at a scene: the picture, depth and objects that the virtual centre camera
                     sees.
scene_commands       Commands about scenes and recipes: list, describe, check, look at.
starting_points      Scenes and recipes to start from: commented files that work as they are written.
templates/           What they are written from.
without_files        Photon counts, truth and views of a scene without a file.
"""

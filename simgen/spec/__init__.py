"""What people write, validated: recipes and scenes with their grids, lights, materials, textures, shapes.

camera_grid       The camera grid as a recipe describes it: places of cameras, how far they are off,
                  their lens.
lights            Lamps and what shines from all around: where they stand, how bright and of what
                  colour they are.
materials         What surfaces do with light: a colour, by a reflectance or a texture, and a finish.
mitsuba_file      A Mitsuba scene that a scene.toml refers to: where it stands, and which files it names.
recipe            Recipes: one TOML file a dataset, resolved and validated before anything is rendered.
scene             Scenes: the world as an object or in a TOML file, in millimetres; no camera in it.
scene_lookup      Where scenes are found: scene.toml files by name or path, and Python functions that draw
                  scenes by number.
shapes            Shapes that objects of a scene can have, in millimetres about the object's position.
sweeps            Recipes whose fields have several values: a dataset for each combination of them.
textures          Patterns that surfaces can carry without an image file; how they are painted is in
                  `paint`.
"""

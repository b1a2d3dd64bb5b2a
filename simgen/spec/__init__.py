"""What people write, validated: recipes and scenes with their grids, lights, materials, shapes.

lights        Lamps and what shines from all around: where they stand, how bright and of what colour.
materials     What surfaces do with light: a reflectance, an image or a pattern, and a finish.
mitsuba_file  A Mitsuba scene that a scene.toml refers to: where it stands, and which files it names.
recipe        Recipes with their camera grid: one TOML file a dataset, validated before anything is rendered.
scene         Scenes: the world as an object or in a TOML file, in millimetres; no camera in it.
scene_lookup  Where scenes are found: scene.toml files, and Python functions that draw scenes by number.
shapes        Shapes of objects, in millimetres about the object's position.
sweeps        Recipes whose fields have several values: a dataset for each combination of them.
"""

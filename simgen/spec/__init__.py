"""What people write, validated: recipes and scenes with their grids, lights, materials, textures, shapes.

camera_grid  The camera grid as a recipe describes it: places of cameras, how far they are off, their
             lens.
lights       Lamps and what shines from all around: where they stand, how bright and of what colour they
             are.
materials    What surfaces do with light: a colour, by a reflectance or a texture, and a finish.
recipe       Recipes: one TOML file a dataset, resolved and validated before anything is rendered.
scene        Scenes: the world in a TOML file, in millimetres; no camera in it.
shapes       Shapes that objects of a scene can have, in millimetres about the object's position.
textures     Patterns that surfaces can carry without an image file; how they are painted is in `paint`.
"""

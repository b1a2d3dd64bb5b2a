"""What a scene or recipe will give, found without rendering it.

depths       Findings on depth: disparities, blur between objects, planes, overlap, colours that are missing.
light        Findings on photons of each object and voxel, and on size, memory and time.
scene_probe  The coarse look at a scene that all findings rest on, and what it shows.
sight        Findings on what the cameras see: objects that are cut or never seen, lamps, glass.
targets      `simgen check`, and what it and `preview` look at: a scene or a recipe, by name or path.
"""

"""What a scene or recipe will give, found without rendering it.

costs             Findings on cost: bytes of each product, memory at the peak, which way the counts are
                  made, time.
depths            Findings on depth: disparities, how far objects stand apart in px of blur, planes,
                  colours that alias.
expected_photons  Findings on photons: who sends them, how many an object and a voxel get, and how many
                  come by mistake.
scene_facts       What a coarse look at a scene shows, and what follows from it: the types of `simgen
                  check`.
scene_probe       The coarse probe of `simgen check`: what few, large pixels of the centre and of the
                  corner cameras see.
sight             Findings on what the cameras see: objects cut or never seen, cameras inside
                  things, lamps.
targets           `simgen check`, and what it and `preview` look at: a scene or a recipe, by name or path.
"""

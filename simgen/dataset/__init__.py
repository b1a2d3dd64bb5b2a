"""From a recipe to a dataset on disk: resources, order of work, resuming, many seeds.

generation  From a recipe to a dataset folder: the order of the work, resuming, and the manifest.
prepared    A recipe with all that it names: its scene, that scene's folder, its camera's sensitivities.
resources   What a recipe takes of the machine, told before any work: memory of each step, bytes of each
            product.
series      A recipe at many seeds: one dataset each, alike in everything but chance.
"""

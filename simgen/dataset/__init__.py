"""From a recipe to a dataset on disk: resources, order of work, resuming, many seeds.

dataset_folder    Whose folder it is: what identifies a dataset, finished ones, and unfinished ones that
                  one run works on.
generation        From a recipe to a dataset folder: the order of the work.
manifest_entries  What the manifest says of a dataset: recipe, scene, software, and what work was skipped.
prepared          A recipe with all that it names, and the parts of it that each stage of the work takes.
rendered_views    Radiance images of every view on disk: products of a dataset, or what its photon counts
                  are drawn from.
resources         What a recipe takes of the machine, estimated before any work: memory of each step,
                  bytes of each product.
reuse             What datasets that are made one after another have in common, made once.
software          The software that a dataset is made with: other versions may give other bytes.
"""

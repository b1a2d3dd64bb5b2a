"""From a recipe to a dataset on disk: resources, order of work, resuming, many seeds.

benchmark_making  Making the public benchmark: all of its datasets as one collection, and their
                  certificate.
dataset_collection  Many datasets as one collection: a series of recipes, each made as a job, one index
                  for all of them.
dataset_folder    Whose folder it is: what identifies a dataset, finished ones, and unfinished ones that
                  one run works on.
generation        From a recipe to a dataset folder: the order of the work, and what datasets have in
                  common.
prepared          A recipe with all that it names, and what each stage of the work takes of it.
rendered_views    Radiance images of every view on disk: products of a dataset, or what its photon counts
                  are drawn from.
resources         What a recipe takes of the machine, estimated before any work, and refused where it
                  cannot fit.
"""

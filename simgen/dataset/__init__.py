"""From a recipe to a dataset on disk: resources, order of work, resuming, many seeds.

benchmark_making    The public benchmark: its datasets as one collection, and their certificate.
croissant_file      Croissant metadata of a collection: JSON-LD that catalogues of datasets read.
dataset_collection  Many datasets as one collection: a job for each recipe, one index for all.
dataset_folder      Whose folder it is: what identifies a dataset, and a mark while one run works on it.
generation          From a recipe to a dataset folder: the order of the work, and what datasets share.
prepared            A recipe with all that it names, and what each stage of the work takes of it.
rendered_views      Radiance images of every view: products, or what photon counts are drawn from.
resources           What a recipe takes of the machine, estimated and refused before any work.
"""

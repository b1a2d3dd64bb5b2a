"""Many datasets of one recipe: sweeps over its fields and draws of its scene, made by one process or many.

collection_folder  The folder of a collection that is being made: whose it is, and the index of what is
                   finished.
dataset_job        The job of making the datasets of a series, piece by piece; several processes at once
                   share it.
series             What a collection is made of: datasets by number, with what distinguishes each from the
                   others.
whole_collection   A whole collection: begun, made by whoever does the work, and its index written.
"""

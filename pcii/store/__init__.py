"""What is on disk: datasets, collections and results, written whole, listed with their hashes, and verified.

collection        Collections of datasets, opened one by one as they are used.
dataset           Datasets: counts, truth and radiance of a dataset folder, each checked when it is read.
dataset_card      README.md of a dataset or collection: what it is, how to open it, and under what terms it
                  may be used.
dataset_layout    The dataset folder on disk: its files, their arrays and its manifest.
dataset_writer    Datasets written from images and truth in memory.
folders           Folders that list their files: hashes, lists of files, and the document that makes a folder
                  a finished one.
manifests         Manifests as pydantic models; members that they do not name are kept.
packed_arrays     Groups of arrays packed into one archive, where many small files would be a burden.
software          The software that a result follows from: versions, hashes of sources, and how those differ.
suggested_depths  Depths to reconstruct: those given, or those that the recipe of a dataset suggests.
verification      Comparison of all files of a dataset, a collection, results or an evaluation with its
                  manifest.
zarr_groups       Groups of arrays on disk: Zarr v3, zstd and crc32c, each array with its axes, unit and
                  meaning.
"""

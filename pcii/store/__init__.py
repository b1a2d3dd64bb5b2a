"""What is on disk: datasets, collections and results, written whole, listed with their hashes, and verified.

benchmark_layout   The public benchmark: its definition, the datasets that follow from it, and their
                   certificate.
collection         Collections of datasets, opened one by one as they are used.
collection_layout  The folder of a collection of datasets: what they have in common, and the index of
                   them.
dataset            Datasets: counts, truth and radiance of a dataset folder, each checked when it is read.
dataset_layout     The dataset folder on disk: its files, their arrays and its manifest.
dataset_writer     Datasets written from images and truth in memory: whole folders that `open_dataset`
                   opens.
evaluation_layout  The folder of an evaluation: rows that grow while several processes measure, and what
                   sums them up.
file_list          Lists of the files of a folder with size and SHA-256, and comparison of the files with
                   such a list.
folder_kind        Kinds of folders: what says that a folder is of one, and the sealed document in it.
given_truth        What a dataset that is written is given of truth and words: checked, and as it is
                   stored.
hashes             SHA-256 of bytes, of files and of what JSON can say.
manifest_schema    Pydantic models of the manifests; members that they do not name are allowed and
                   ignored.
results_list       The file results.json: dataset, light and software of the results in a folder, and their
                   files.
sample_dataset     The sample dataset that comes with the package, for trying things without a renderer.
sealed_json        JSON documents that end in a checksum of themselves, and JSON of strangers.
software           The software that a result follows from: versions, hashes of sources, and how those
                   differ.
suggested_depths   Depths to reconstruct: those given, or those that the recipe of a dataset suggests.
verification       Comparison of all files of a dataset, a collection, results or an evaluation with its
                   manifest.
zarr_groups        Groups of arrays on disk: Zarr v3, zstd and crc32c, each array with its axes, unit and
                   meaning.
"""

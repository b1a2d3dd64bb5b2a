"""Files: datasets and lists of results, sealed and checked, and what a dataset's recipe suggests.

dataset           Opening a dataset folder: counts, truth and radiance as the package's types, checked as
                  read.
dataset_layout    The dataset folder on disk: its layout, and what may be in its manifest.
manifest_schema   What a manifest must hold, as pydantic models; what they do not name is allowed and not
                  looked at.
results_list      results.json: whose results a folder holds, and every file of them with size and
                  SHA-256.
sealed_json       JSON documents that list the files of a folder and carry a checksum of themselves.
stored_radiance   Radiance that stays on disk, one EXR file a view, until a view is looked at.
suggested_depths  The depths that a dataset's recipe suggests to look at.
verification      Whether a dataset, or a folder of results, is what was written: every file, and no more.
zarr_groups       Groups of arrays on disk: Zarr v3, zstd and crc32c, each array with its axes, unit and
                  meaning.
"""

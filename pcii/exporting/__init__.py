"""Cards of datasets and collections.

dataset_card         README.md of a dataset or collection: what it is, how to open it, and under what terms
                     it may be used.
"""

"""Cards of datasets and collections.

card_files           README.md and croissant.json of a dataset or collection, written beside its files.
croissant_document   Datasets and collections as JSON-LD in the Croissant format 1.0 of MLCommons.
dataset_card         The card of a dataset or collection: README.md for people, in Markdown.
publication_terms    Under what terms a dataset is published, and who made it: what its card says and its
                     data do not.
"""

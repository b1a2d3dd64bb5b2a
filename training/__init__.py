"""How the network of depth and masks is made (`make train`); nothing here is needed to use it.

Datasets of `recipes` become `examples`, with `flat_films` among them. Of these come `batches`, each example
with one of its `requests`; `fit` trains the network of `layers` by its `losses`, and `exported_files` are
what `pcii` runs. `__main__` does all of it in its order.
"""

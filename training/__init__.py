"""How the network of depth is made (`make train`); nothing here is needed to use it.

export     Write trained weights as the files that `pcii` runs.
fit        Train the network on examples.
layers     The network in PyTorch.
recipes    Datasets to make examples of, for `simgen generate`.
samples    Examples: inputs of the network for datasets, at random amounts of light, with the true depth.
scenes     Distributions of scenes that are for training alone.
"""

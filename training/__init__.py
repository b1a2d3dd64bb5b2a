"""How the network of depth and masks is made (`make train`); nothing here is needed to use it.

examples     Batches of examples: parts of films, each with a request of its own.
export       Write trained weights as the files that `pcii` runs.
fit          Train the network on examples.
layers       The network in PyTorch.
recipes      Datasets to make examples of, for `simgen generate`.
requests     Which planes an example is asked for, and which object belongs to which of them.
samples      Examples: inputs of the network for datasets, at random amounts of light, with the truth.
"""

"""How the network of depth and masks is made (`make train`); nothing here is needed to use it.

recipes        Datasets to make examples of, for `simgen generate`.
examples       Examples: inputs of the network for datasets, at random amounts of light, with the truth.
flat_films     Examples of films that show no depth.
requests       Which planes an example is asked for, and which object belongs to which of them.
batches        Parts of examples, mirrored and transposed at random, on the device.
layers         The network in PyTorch.
losses         What training makes small.
fit            Train the network on examples.
exported_files The trained network as the files that `pcii` runs, and back.
__main__       All of it in its order, going on from where it was stopped.
"""

"""Removal by likelihood: regions, opaque layers, outlines.

hiding_kernels     Compiled loops over events: which layers hide them, and how well layers predict them.
layer_kernels      Compiled loops over rays: which layer does each camera see, and what is behind it?
layer_search       The search for the opaque layers of least energy: sweeps over the layers, then proposals of
                   whole pieces.
layers             Opaque layers at the requested depths, fitted to all photons together: what hides what?
likelihood_method  Removal of defocused points by likelihood: what is in focus at each plane, down to a
                   few photons a pixel.
outline            Outlines of regions to the pixel: where does a region's light end?
outline_kernels    The compiled loop that finds an outline of least length (serial: pictures are small).
proposals          Pieces that may belong to another layer than the one that is seen there now.
regions            Regions of one plane, and whether the light says that they are there.
"""

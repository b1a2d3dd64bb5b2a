"""Estimators of depth.

chain_kernels        Compiled: posterior probabilities along chains of blocks, by passing messages forward
                     and backward.
depth_planes         Planes that a search of depth compares, and the depth between planes where a measure is
                     largest.
explained_views      What the photons of all cameras say of masks of sheets, by an objective that does not
                     fall, and of depths.
methods              Estimators of depth by name: a depth for each pixel of the virtual centre.
network_inputs       What the network of depth is given: evidence, the posterior of a surface, brightness,
                     coverage.
posterior_depth      Depth from its posterior probability: evidence of texture, smooth surfaces, a network,
                     and, of photon counts, sheets.
posterior_of_sheets  What a posterior becomes after sheets have explained the photons of all cameras.
sheet_kernels        Compiled: where rays meet sheets, what photons and cameras see of them, and textures.
sheet_textures       Textures of sheets: how bright blocks are, from the photons that reach them, in windows
                     as wide as needed.
sheets               Sheets, the few surfaces that a posterior of depth consists of, and what is known of
                     each block of them.
smooth_surface       The posterior probability of depth of a piecewise smooth surface.
surface_network      The posterior probability of depth by a network that has seen many surfaces.
"""

"""Sections of the scene: Eqs. 2 and 3 from events and from images, demosaicing (Eqs. 4-6), statistics.

demosaic_kernels   Compiled loops of Laroche-Prescott demosaicing.
demosaicing        Demosaicing of Bayer images: the gradient-based interpolation of Laroche and Prescott,
                   and three others.
dense_kernels      Compiled loops that add up whole images, with their variances.
dense_sections     Sections of dense images: whole rows of every view added to whole rows of the section.
event_kernels      Compiled loops over photons: sections, and samples of windows.
film_parts         Parts of the film: what of every view a part of the sections is made of.
image_moves        Whole-pixel moves of whole images: by how much each view moves, with what weight, in
                   what order.
photon_statistics  Statistics of photon counts: pooled samples, entropy, and the variance of Poisson
                   noise.
probe_planes       Planes to compare: an object is in focus at z only if no other depth explains it
                   better.
recycled_memory    Memory of sections that nobody holds any more, for the next ones.
reconstruction     Computational reconstruction of sections: Muniraj et al. 2017, Eqs. 2 and 3.
row_kernels        Compiled functions for one row of a section: sums of shifted images, and of their
                   squared deviations.
saturation         What frames of few bits miss: the share of the photons that saturation removed,
                   estimated from the counts.
"""

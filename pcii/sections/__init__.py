"""Sections of the scene: Eqs. 2 and 3 from events and from images, demosaicing (Eqs. 4-6), statistics.

demosaicing        Demosaicing of Bayer images: the gradient-based interpolation of Laroche and Prescott.
dense_sections     Sections of dense images: whole rows of every view added to whole rows of the section.
kernels            Compiled loops: sums of images and of photons, squared deviations, samples, demosaicing.
photon_statistics  Statistics of photon counts: pooled samples, entropy, the variance of Poisson noise,
                   and saturation.
reconstruction     Computational reconstruction of sections: Muniraj et al. 2017, Eqs. 2 and 3.
"""

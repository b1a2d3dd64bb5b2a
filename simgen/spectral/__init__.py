"""Spectra of lights, surfaces and cameras, by wavelength.

filters  What a camera's pixels see of a spectrum, and the wavelengths that tell most about it.
spectra  Spectra of lights and surfaces, on one set of wavelengths; measured ones from colour-science.
"""

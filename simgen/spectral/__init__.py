"""Spectra of lights, surfaces and cameras, by wavelength.

camera_curves  Spectral sensitivities of cameras: of those that colour-science has, or from a CSV file.
filters        What a camera's pixels see of a spectrum, and the wavelengths that tell most about it.
spectra        Spectra of lights, surfaces and cameras, on one set of wavelengths; measured ones from
               colour-science.
"""

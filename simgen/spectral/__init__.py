"""Spectra of lights, surfaces and cameras, by wavelength."""

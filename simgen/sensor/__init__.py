"""What a sensor makes of light: mosaic, faults, exposure.

detector      What a real sensor makes of the photons that arrive: losses, false counts, limits.
exposure      Absolute exposure: how many photons a pixel catches of a scene's light.
mosaic        From radiance to photon counts: Bayer mosaic, normalisation to a photon budget, photon
              statistics.
photon_table  The one table of photons, from where they are drawn to the file that they are written to.
"""

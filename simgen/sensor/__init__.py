"""What a sensor makes of light: exposure, losses, false counts, frames.

detector      From light to counts: photons of a unit of radiance, counts of a pixel, frames of an exposure.
photon_table  The one table of photons, from where they are drawn to the file that they are written to.
"""

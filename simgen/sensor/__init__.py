"""What a sensor makes of light: mosaic, faults, exposure.

detector       What a real sensor makes of the photons that arrive: losses, false counts. All off by default.
frame_readout  Frames of an exposure: in which of them a photon is counted, and where the pixel's counter
               stops.
mosaic         Colours that a sensor's pixels take, and photon counts drawn from expected ones.
photon_table   The one table of photons, from where they are drawn to the file that they are written to.
"""

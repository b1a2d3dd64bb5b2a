"""Photon counts: by thinning a majorant, or from rendered views, and which of the two.

bright_light          Bright light that few paths meet: what holds it, how much it is, and where it is seen.
candidates            Candidates of photons: rays drawn from a majorant, and followed if they may be
                      bright enough to be kept.
counting_plan         How photon counts will be made: thinned one by one, or drawn from rendered views, and
                      what led to it.
disparity_layers      Layers of disparity and their tiles: pieces of surface that all views share.
emission_sampler      Candidates of photons that come straight from something that shines, drawn on its
                      surface.
exploration           What is found out about a scene's light before photons are drawn: the majorant, and
                      what it keeps.
majorant              How bright it can get where: the majorant from which photon candidates are drawn.
mirror_images         Photons of lamps that are seen by mirrors and through glass, drawn where their images
                      fall on the films.
photon_counting       The photon counts of a dataset: thinned or drawn from views, counted by the sensor,
                      written.
scalar_sampler        Candidates one after the other, for scalar mode: drawn in NumPy, traced by one call
                      of the renderer each.
scopes                Scopes: what photons are counted over, which is an exposure of each view or a budget.
shining_pieces        Pieces of all that shines and can be seen, each with a bound of how many photons its
                      points send to a film.
thinning              Photons, not pixels: photon-limited images by thinning, in the time that their
                      photons take.
wavefront_sampler     Candidates drawn and traced all at once in the renderer's arrays, for compiled backends.
"""

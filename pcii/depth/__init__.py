"""Depth of each pixel, with its probability.

Evidence becomes a posterior by the smoothness of surfaces and a network; sheets cut from it explain the
photons of all cameras.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

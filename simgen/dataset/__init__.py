"""From a recipe to a dataset on disk: resources, order of work, resuming, many seeds."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

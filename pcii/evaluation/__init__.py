"""Many datasets: rows, intervals, paired tests, tables and pages; and the public benchmark."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

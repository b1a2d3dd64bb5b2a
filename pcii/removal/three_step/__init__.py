"""The paper's removal in three steps: threshold, boundary, entropy (Eqs. 7-9)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""What a sensor makes of light: exposure, losses, false counts, frames."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

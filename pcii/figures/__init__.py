"""Every drawing: 8-bit pictures of arrays, what Matplotlib draws for `.plot()` and notebooks, and pages.

Every `.plot(axes=None, ...)` draws into the Matplotlib axes that it gets, or else into a new figure of
`pyplot`, and returns them as an array (N,), one for each panel. It takes them as a list, one panel's alone
too. Where no depth is answered a picture is grey, a colour that no map of values has. Matplotlib is imported
on the first picture.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

from . import methods as methods
from .methods import DEFAULT_METHODS as DEFAULT_METHODS, METHODS as METHODS, find_method as find_method
from .methods import masks_of as masks_of, removal_methods as removal_methods, segment as segment

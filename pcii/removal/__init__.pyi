from . import methods as methods
from .methods import DEFAULT_METHODS as DEFAULT_METHODS, METHODS as METHODS, find_method as find_method
from .methods import masks_of as masks_of, removal_methods as removal_methods, segment as segment
from .three_step_method import ThreeStep as ThreeStep, adaptive_threshold as adaptive_threshold
from .three_step_method import roberts_magnitude as roberts_magnitude, without_specks as without_specks
from .watershed_pieces import cheapest_planes as cheapest_planes, pieces_along_ridges as pieces_along_ridges

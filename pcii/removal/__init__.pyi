from . import methods as methods
from .methods import DEFAULT_METHODS as DEFAULT_METHODS, find_method as find_method, masks_of as masks_of
from .methods import METHODS as METHODS, removal_methods as removal_methods, segment as segment
from .three_step_method import adaptive_threshold as adaptive_threshold
from .three_step_method import roberts_magnitude as roberts_magnitude, ThreeStep as ThreeStep
from .three_step_method import without_specks as without_specks
from .watershed_pieces import cheapest_planes as cheapest_planes, pieces_along_ridges as pieces_along_ridges

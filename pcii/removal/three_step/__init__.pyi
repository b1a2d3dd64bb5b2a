from .bright_regions import SMALLEST_REGION_PX as SMALLEST_REGION_PX, brightness as brightness
from .bright_regions import roberts_magnitude as roberts_magnitude, without_specks as without_specks
from .three_step_method import ThreeStep as ThreeStep
from .watershed_pieces import cheapest_planes as cheapest_planes, pieces_along_ridges as pieces_along_ridges

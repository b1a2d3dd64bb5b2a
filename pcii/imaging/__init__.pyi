from .blocks import block_sums as block_sums, evenly_chosen as evenly_chosen, on_pixels as on_pixels
from .blocks import sum_of as sum_of, window_sums as window_sums
from .bright_regions import EDGE_SMOOTHING_PX as EDGE_SMOOTHING_PX, SMALLEST_REGION_PX as SMALLEST_REGION_PX
from .bright_regions import box_around as box_around, brightness as brightness, large_pieces as large_pieces
from .bright_regions import outlined as outlined, roberts_magnitude as roberts_magnitude
from .bright_regions import without_specks as without_specks
from .mask_outlines import boundary_f as boundary_f, object_share as object_share
from .watershed_pieces import cheapest_planes as cheapest_planes, pieces_along_ridges as pieces_along_ridges

from .arrays import check_depth_range as check_depth_range, check_z_mm as check_z_mm, is_whole as is_whole
from .arrays import LARGEST_COUNT as LARGEST_COUNT, MOST_DEPTHS as MOST_DEPTHS, read_only as read_only
from .arrays import whole_counts as whole_counts
from .cameras import CameraGrid as CameraGrid, channel_count as channel_count, check_cfa as check_cfa
from .cameras import clipped_mean as clipped_mean, colour_cells as colour_cells, colour_index as colour_index
from .cameras import COLOURS as COLOURS, colours_and_samples as colours_and_samples, mosaic as mosaic
from .cameras import MOST_BITS as MOST_BITS, MOST_FRAMES as MOST_FRAMES, NEGLIGIBLE_LOSS as NEGLIGIBLE_LOSS
from .cameras import PATTERNS as PATTERNS, PLAIN as PLAIN, Readout as Readout
from .estimates import DepthMap as DepthMap, DepthPosterior as DepthPosterior, Score as Score
from .estimates import Segmented as Segmented
from .focal_planes import blur_half_extent_px as blur_half_extent_px, check_data as check_data
from .focal_planes import check_depth_counts as check_depth_counts
from .focal_planes import depth_of_total_disparity_mm as depth_of_total_disparity_mm
from .focal_planes import disparity_px as disparity_px, FocalPlanes as FocalPlanes
from .focal_planes import parallax_per_total as parallax_per_total, parallax_px as parallax_px
from .focal_planes import Sections as Sections, Shifts as Shifts
from .focal_planes import total_disparity_px as total_disparity_px
from .images import binary_scale as binary_scale, EXPOSURE as EXPOSURE, FULL_LIGHT as FULL_LIGHT
from .images import Light as Light, limit_photons as limit_photons, MOST_PHOTONS as MOST_PHOTONS
from .images import photon_rates as photon_rates, Scope as Scope, scope_energies as scope_energies
from .images import sense as sense, Views as Views
from .photon_counts import PhotonCounts as PhotonCounts
from .truth import OPTIONAL_MAPS as OPTIONAL_MAPS, PhotonTruth as PhotonTruth, Truth as Truth

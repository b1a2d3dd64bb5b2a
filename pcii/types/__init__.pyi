from .array_labels import COUNTS_LABELS as COUNTS_LABELS, DEPTH_LABELS as DEPTH_LABELS, Label as Label
from .array_labels import PHOTON_TRUTH_LABELS as PHOTON_TRUTH_LABELS, SECTIONS_LABELS as SECTIONS_LABELS
from .array_labels import SEGMENTED_LABELS as SEGMENTED_LABELS, TRUTH_LABELS as TRUTH_LABELS
from .arrays import LARGEST_COUNT as LARGEST_COUNT, MOST_DEPTHS as MOST_DEPTHS, check_z_mm as check_z_mm
from .arrays import is_whole as is_whole, read_only as read_only, whole_counts as whole_counts
from .bayer import COLOURS as COLOURS, PATTERNS as PATTERNS, channel_count as channel_count
from .bayer import check_cfa as check_cfa, colour_cells as colour_cells, colour_index as colour_index
from .bayer import colours_and_samples as colours_and_samples, mosaic as mosaic
from .camera_grid import CameraGrid as CameraGrid
from .estimates import DepthMap as DepthMap, DepthPosterior as DepthPosterior, Score as Score
from .estimates import Segmented as Segmented
from .focal_planes import FocalPlanes as FocalPlanes, check_data as check_data
from .focal_planes import check_depth_counts as check_depth_counts
from .geometry import blur_half_extent_px as blur_half_extent_px
from .geometry import depth_of_total_disparity_mm as depth_of_total_disparity_mm, disparity_px as disparity_px
from .geometry import parallax_per_total as parallax_per_total, parallax_px as parallax_px
from .geometry import project_px as project_px, total_disparity_px as total_disparity_px
from .images import Views as Views, binary_scale as binary_scale
from .photon_counts import PhotonCounts as PhotonCounts
from .photon_limit import EXPOSURE as EXPOSURE, FULL_LIGHT as FULL_LIGHT, Light as Light
from .photon_limit import MOST_PHOTONS as MOST_PHOTONS, Scope as Scope, limit_photons as limit_photons
from .photon_limit import photon_rates as photon_rates, scope_energies as scope_energies, sense as sense
from .readout import MOST_BITS as MOST_BITS, MOST_FRAMES as MOST_FRAMES, NEGLIGIBLE_LOSS as NEGLIGIBLE_LOSS
from .readout import PLAIN as PLAIN, Readout as Readout, clipped_mean as clipped_mean
from .section_stack import Sections as Sections, Shifts as Shifts
from .truth import OPTIONAL_MAPS as OPTIONAL_MAPS, PhotonTruth as PhotonTruth, Truth as Truth

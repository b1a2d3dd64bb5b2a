from . import detector as detector
from .detector import counts_of as counts_of, dark_map as dark_map, detect as detect
from .detector import draw_counts as draw_counts, fixed_totals as fixed_totals
from .detector import full_light_image as full_light_image, nested_subset as nested_subset
from .detector import photons_per_radiance as photons_per_radiance, read_out as read_out
from .detector import sensitivities as sensitivities
from .photon_table import PhotonTable as PhotonTable, joined as joined, no_photons as no_photons

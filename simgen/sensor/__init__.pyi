from . import detector as detector
from .detector import counts_of as counts_of, detect as detect, full_light_image as full_light_image
from .detector import nested_subset as nested_subset, photons_per_radiance as photons_per_radiance
from .detector import read_out as read_out
from .photon_table import PhotonTable as PhotonTable, joined as joined, no_photons as no_photons

from . import spectra as spectra
from .filters import CELLS as CELLS, Filters as Filters, HEROES as HEROES, camera_names as camera_names
from .filters import filters_for as filters_for, sensitivity as sensitivity
from .spectra import DAYLIGHT as DAYLIGHT, WAVELENGTH_NM as WAVELENGTH_NM
from .spectra import colour_science as colour_science, illuminant as illuminant
from .spectra import illuminant_names as illuminant_names, integral as integral
from .spectra import linear_srgb as linear_srgb
from .spectra import known_illuminant as known_illuminant, known_patch as known_patch, observer as observer
from .spectra import patch as patch, patch_names as patch_names, srgb_of as srgb_of

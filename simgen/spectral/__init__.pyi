from . import spectra as spectra
from .filters import CELLS as CELLS, Filters as Filters, filters_for as filters_for, HEROES as HEROES
from .spectra import camera_names as camera_names, colour_science as colour_science, DAYLIGHT as DAYLIGHT
from .spectra import illuminant as illuminant, illuminant_names as illuminant_names, integral as integral
from .spectra import known_illuminant as known_illuminant, known_patch as known_patch
from .spectra import linear_srgb as linear_srgb, observer as observer, patch as patch
from .spectra import patch_names as patch_names, sensitivity as sensitivity, srgb_of as srgb_of
from .spectra import WAVELENGTH_NM as WAVELENGTH_NM

from .candidates import Setup as Setup
from .counting_plan import Capture as Capture, PHOTON_COST as PHOTON_COST, Plan as Plan
from .counting_plan import SAMPLE_COST as SAMPLE_COST, SCALAR_PHOTON_COST as SCALAR_PHOTON_COST
from .counting_plan import SCALAR_SAMPLE_COST as SCALAR_SAMPLE_COST, plan as plan, probe as probe
from .disparity_layers import layers_for as layers_for, tile_px_for as tile_px_for
from .emission_sampler import EmissionSampler as EmissionSampler
from .exploration import Exploration as Exploration, MAX_RAYS as MAX_RAYS, explore as explore
from .majorant import Majorant as Majorant, fit as fit
from .photon_counting import draw_from_views as draw_from_views, thin as thin, write_counts as write_counts
from .thinning import thin_photons as thin_photons

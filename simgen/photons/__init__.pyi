from .capture import Capture as Capture, ranks_in_scopes as ranks_in_scopes
from .counting_plan import MAX_NOISE_SHARE as MAX_NOISE_SHARE, PHOTON_COST as PHOTON_COST
from .counting_plan import SAMPLE_COST as SAMPLE_COST, SCALAR_PHOTON_COST as SCALAR_PHOTON_COST
from .counting_plan import SCALAR_SAMPLE_COST as SCALAR_SAMPLE_COST, plan_counts as plan_counts
from .counting_plan import probe as probe
from .disparity_layers import layers_for as layers_for, tile_px_for as tile_px_for
from .emission_sampler import EmissionSampler as EmissionSampler
from .exploration import Plan as Plan, explore as explore
from .majorant import Majorant as Majorant, fit as fit
from .pilot import MAX_RAYS as MAX_RAYS
from .thinning import thin_photons as thin_photons

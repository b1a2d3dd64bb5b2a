from .candidates import Capture as Capture, ranks_in_scopes as ranks_in_scopes
from .counting_plan import MAX_NOISE_SHARE as MAX_NOISE_SHARE, PHOTON_COST as PHOTON_COST
from .counting_plan import SAMPLE_COST as SAMPLE_COST, SCALAR_PHOTON_COST as SCALAR_PHOTON_COST
from .counting_plan import SCALAR_SAMPLE_COST as SCALAR_SAMPLE_COST, plan_counts as plan_counts
from .counting_plan import probe as probe
from .emission_sampler import EmissionSampler as EmissionSampler
from .exploration import MAX_RAYS as MAX_RAYS, Plan as Plan, explore as explore
from .majorant import Majorant as Majorant, Samples as Samples, fit as fit, layers_for as layers_for
from .majorant import tile_px_for as tile_px_for
from .thinning import thin_photons as thin_photons

from .bright_light import MAX_RAYS as MAX_RAYS
from .candidates import Capture as Capture, ranks_in_scopes as ranks_in_scopes
from .counting_plan import MAX_NOISE_SHARE as MAX_NOISE_SHARE, PHOTON_COST as PHOTON_COST
from .counting_plan import plan_counts as plan_counts, probe as probe, SAMPLE_COST as SAMPLE_COST
from .counting_plan import SCALAR_PHOTON_COST as SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST as SCALAR_SAMPLE_COST
from .emission_sampler import EmissionSampler as EmissionSampler
from .exploration import explore as explore, Plan as Plan
from .majorant import fit as fit, layers_for as layers_for, Majorant as Majorant, Samples as Samples
from .majorant import tile_px_for as tile_px_for
from .thinning import thin_photons as thin_photons

from .demosaicing import demosaic as demosaic
from .dense_sections import in_memory as in_memory
from .photon_statistics import entropy_bits as entropy_bits
from .photon_statistics import photons_around_a_photon as photons_around_a_photon
from .photon_statistics import pooled_estimate as pooled_estimate, pooled_plane as pooled_plane
from .photon_statistics import pooled_samples as pooled_samples, region_entropy_bits as region_entropy_bits
from .photon_statistics import section_window_px as section_window_px
from .photon_statistics import truncated_poisson_variance as truncated_poisson_variance
from .photon_statistics import view_samples as view_samples, ViewSamples as ViewSamples
from .photon_statistics import warn_of_saturation as warn_of_saturation
from .reconstruction import depth_range_of as depth_range_of, extend as extend, has_depths as has_depths
from .reconstruction import planes_of as planes_of, PROBE_STEPS_PX as PROBE_STEPS_PX
from .reconstruction import reconstruct as reconstruct, with_probes as with_probes

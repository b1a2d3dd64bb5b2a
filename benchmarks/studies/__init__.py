"""The studies of run time against error, in the order of the page.

photon_images     Photon counts by thinning and by dense rendering, and how far they are from the truth.
photon_costs      What a photon costs at the paper's size, and how that grows.
radiance_images   Rendered views by samples per pixel, against a long rendering.
sections          Errors of sections of a known texture, ours and other packages'.
depth_and_focus   Depth and removal by every method over photon budgets.
skips             Work that is skipped: on against off.
end_to_end        From a recipe to a report, beside a plain script.
"""

from benchmarks.results import Study
from benchmarks.studies import (
    depth_and_focus,
    end_to_end,
    photon_costs,
    photon_images,
    radiance_images,
    sections,
    skips,
)

STUDIES: tuple[Study, ...] = (
    photon_images.STUDY,
    photon_costs.STUDY,
    radiance_images.STUDY,
    sections.STUDY,
    depth_and_focus.STUDY,
    skips.STUDY,
    end_to_end.STUDY,
)

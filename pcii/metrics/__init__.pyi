from . import scoring as scoring
from .depth_accuracy import calibration as calibration, depth_bound_px as depth_bound_px
from .depth_accuracy import depth_errors as depth_errors, hci_errors as hci_errors
from .depth_accuracy import object_bounds as object_bounds
from .scoring import boundary_f as boundary_f, mask_agreement as mask_agreement, object_share as object_share
from .scoring import score as score
from .true_masks import entropy_region as entropy_region, TrueFocus as TrueFocus

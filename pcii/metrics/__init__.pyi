from . import scoring as scoring
from .bounds import depth_bound_px as depth_bound_px, object_bounds as object_bounds
from .depth_accuracy import calibration as calibration, depth_errors as depth_errors, hci_errors as hci_errors
from .scoring import entropy_region as entropy_region, object_share as object_share, score as score
from .true_masks import TrueFocus as TrueFocus, boundary_f as boundary_f, mask_agreement as mask_agreement

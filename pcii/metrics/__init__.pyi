from . import scoring as scoring
from .depth_accuracy import calibration as calibration, depth_bound_px as depth_bound_px
from .depth_accuracy import depth_errors as depth_errors, hci_errors as hci_errors
from .depth_accuracy import object_bounds as object_bounds
from .scoring import boundary_f as boundary_f, entropy_half_widths as entropy_half_widths
from .scoring import mask_agreement as mask_agreement, object_share as object_share, score as score
from .true_masks import TrueFocus as TrueFocus

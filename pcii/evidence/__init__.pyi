from .camera_fit import CameraFit as CameraFit, check_grid as check_grid, MAX_DEPTHS as MAX_DEPTHS
from .camera_fit import MIN_DEPTH_SHARE as MIN_DEPTH_SHARE
from .hot_pixels import without_hot_pixels as without_hot_pixels
from .shown_depth import ShownDepth as ShownDepth
from .texture_evidence import doubled as doubled, evidence_of_texture as evidence_of_texture
from .texture_evidence import gaussian_mean as gaussian_mean, gaussian_weights as gaussian_weights
from .texture_evidence import PHOTON_CELL_BLOCKS as PHOTON_CELL_BLOCKS, TextureEvidence as TextureEvidence
from .texture_evidence import TextureModel as TextureModel

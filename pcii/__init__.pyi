__version__: str
__all__: list[str]

from .base.pixel_arithmetic import srgb_to_linear as srgb_to_linear
from .base.plain_text import InputError as InputError
from .depth.methods import depth_methods as depth_methods, depth_posterior as depth_posterior
from .depth.methods import estimate_depth as estimate_depth
from .evaluation.comparison import evaluate as evaluate
from .evaluation.summary import mean_interval as mean_interval, sign_flip_p as sign_flip_p
from .evaluation.training_examples import Examples as Examples, examples as examples
from .evidence.camera_fit import check_grid as check_grid
from .exchange.count_arrays import import_counts as import_counts
from .exchange.elemental_images import LensArray as LensArray, import_arrays as import_arrays
from .exchange.elemental_images import import_images as import_images
from .exchange.elemental_images import import_lens_array as import_lens_array
from .exchange.export_formats import export_dataset as export_dataset
from .exchange.frame_files import FrameFormat as FrameFormat
from .exchange.hci_scenes import import_hci as import_hci
from .exchange.stated_images import Optics as Optics, ViewOrder as ViewOrder
from .metrics.scoring import score as score
from .metrics.true_masks import TrueFocus as TrueFocus
from .removal.methods import removal_methods as removal_methods, segment as segment
from .removal.three_step_method import ThreeStep as ThreeStep
from .sections.demosaicing import demosaic as demosaic
from .sections.reconstruction import reconstruct as reconstruct
from .store.collection import Collection as Collection, open_collection as open_collection
from .store.dataset import Dataset as Dataset, open_dataset as open_dataset, sample as sample
from .store.dataset_writer import save_dataset as save_dataset
from .store.provenance import verify as verify
from .types.cameras import CameraGrid as CameraGrid
from .types.estimates import DepthMap as DepthMap, DepthPosterior as DepthPosterior, Score as Score
from .types.estimates import Segmented as Segmented
from .types.focal_planes import FocalPlanes as FocalPlanes, Sections as Sections
from .types.images import Light as Light, Views as Views, limit_photons as limit_photons
from .types.photon_counts import PhotonCounts as PhotonCounts
from .types.truth import Truth as Truth

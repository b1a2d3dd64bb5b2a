"""Photon-counted integral imaging: reconstruct, remove what is out of focus, score.

Importing this package loads NumPy and nothing heavier: SciPy, Numba, Zarr and Matplotlib are imported
inside the functions that need them.
"""

__version__ = "0.1.0"

from pcii.base.errors import InputError
from pcii.base.srgb import srgb_to_linear
from pcii.depth.methods import depth_methods, depth_posterior, estimate_depth
from pcii.evaluation.comparison import evaluate
from pcii.evaluation.summary import mean_interval, sign_flip_p
from pcii.evaluation.training_examples import Examples, examples
from pcii.evidence.camera_fit import check_grid
from pcii.exchange.count_arrays import import_arrays, import_counts
from pcii.exchange.export_formats import export_dataset
from pcii.exchange.frame_formats import FrameFormat
from pcii.exchange.hci_scenes import import_hci
from pcii.exchange.image_folders import LensArray, import_images, import_lens_array
from pcii.exchange.stated_cameras import Optics, ViewOrder
from pcii.metrics.scoring import score
from pcii.metrics.true_masks import TrueFocus
from pcii.removal.methods import removal_methods, segment
from pcii.removal.three_step.three_step_method import ThreeStep
from pcii.sections.demosaicing import demosaic
from pcii.sections.reconstruction import reconstruct
from pcii.store.collection import Collection, open_collection
from pcii.store.dataset import Dataset, open_dataset, sample
from pcii.store.dataset_writer import save_dataset
from pcii.store.verification import verify
from pcii.types.camera_grid import CameraGrid
from pcii.types.estimates import DepthMap, DepthPosterior, Score, Segmented
from pcii.types.focal_planes import FocalPlanes
from pcii.types.images import Views
from pcii.types.photon_counts import PhotonCounts
from pcii.types.photon_limit import Light, limit_photons
from pcii.types.section_stack import Sections
from pcii.types.truth import Truth

__all__ = [
    "CameraGrid",
    "Collection",
    "Dataset",
    "DepthMap",
    "DepthPosterior",
    "Examples",
    "FocalPlanes",
    "FrameFormat",
    "InputError",
    "LensArray",
    "Light",
    "Optics",
    "PhotonCounts",
    "Score",
    "Sections",
    "Segmented",
    "ThreeStep",
    "TrueFocus",
    "Truth",
    "ViewOrder",
    "Views",
    "check_grid",
    "demosaic",
    "depth_methods",
    "depth_posterior",
    "estimate_depth",
    "evaluate",
    "examples",
    "export_dataset",
    "import_arrays",
    "import_counts",
    "import_hci",
    "import_images",
    "import_lens_array",
    "limit_photons",
    "mean_interval",
    "open_collection",
    "open_dataset",
    "reconstruct",
    "removal_methods",
    "sample",
    "save_dataset",
    "score",
    "segment",
    "sign_flip_p",
    "srgb_to_linear",
    "verify",
]

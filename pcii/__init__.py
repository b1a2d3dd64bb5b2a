"""Photon-counted integral imaging: reconstruct, remove what is out of focus, score.

Importing this package loads NumPy and nothing heavier: SciPy, Numba, Zarr and Matplotlib are imported
inside the functions that need them. The imports below are eager because modules and the functions
they are named for share names, and only an eager import leaves the function under that name.
"""

__version__ = "0.1.0"

from pcii.dataset import Dataset, open_dataset
from pcii.demosaic import demosaic
from pcii.depth import estimate_depth
from pcii.errors import InputError
from pcii.evaluate import evaluate
from pcii.photon_counts import PhotonCounts
from pcii.reconstruct import reconstruct, reconstruct_each
from pcii.score import score
from pcii.segment import removal_methods, segment
from pcii.three_step import ThreeStep
from pcii.types import CameraGrid, DepthMap, Score, Sections, Segmented, Truth, Views

__all__ = [
    "CameraGrid",
    "Dataset",
    "DepthMap",
    "InputError",
    "PhotonCounts",
    "Score",
    "Sections",
    "Segmented",
    "ThreeStep",
    "Truth",
    "Views",
    "demosaic",
    "estimate_depth",
    "evaluate",
    "open_dataset",
    "reconstruct",
    "reconstruct_each",
    "removal_methods",
    "score",
    "segment",
]

from .array_files import open_array as open_array
from .count_arrays import import_arrays as import_arrays, import_counts as import_counts
from .depth_files import DepthFile as DepthFile, NO_DEPTH as NO_DEPTH
from .export_formats import export as export, export_dataset as export_dataset
from .export_pictures import write_png as write_png
from .frame_formats import AS_COUNTED as AS_COUNTED, FrameFormat as FrameFormat
from .hci_scenes import import_hci as import_hci
from .image_folders import LensArray as LensArray, import_images as import_images
from .image_folders import import_lens_array as import_lens_array
from .import_requests import Cameras as Cameras, Lenses as Lenses, Pair as Pair, PictureLight as PictureLight
from .import_requests import WholePair as WholePair, read as read
from .pixel_files import UPRIGHT as UPRIGHT, decode as decode, picture_of as picture_of
from .posed_views import camera_grid_of as camera_grid_of, find_grid as find_grid
from .stated_cameras import AS_STORED as AS_STORED, Note as Note, Optics as Optics, ViewOrder as ViewOrder
from .transforms_file import TransformsFile as TransformsFile, read_transforms as read_transforms

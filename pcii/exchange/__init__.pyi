from .count_arrays import import_counts as import_counts
from .depth_files import DepthFile as DepthFile, NO_DEPTH as NO_DEPTH
from .elemental_images import Encoding as Encoding, KnownViews as KnownViews, LensArray as LensArray
from .elemental_images import import_arrays as import_arrays, import_images as import_images
from .elemental_images import import_interlaced as import_interlaced, import_lens_array as import_lens_array
from .export_formats import export as export, export_dataset as export_dataset
from .frame_files import AS_COUNTED as AS_COUNTED, FrameFormat as FrameFormat
from .hci_scenes import import_hci as import_hci, PARAMETERS as PARAMETERS, write_png as write_png
from .number_files import decode as decode, kind_of as kind_of, open_array as open_array
from .number_files import picture_of as picture_of, UPRIGHT as UPRIGHT, VIEWS as VIEWS
from .posed_views import find_grid as find_grid, import_posed_cubes as import_posed_cubes
from .posed_views import import_posed_pictures as import_posed_pictures
from .stated_images import AS_STORED as AS_STORED, Note as Note, Optics as Optics
from .stated_images import ViewOrder as ViewOrder
from .transforms_file import read_transforms as read_transforms, TRANSFORMS as TRANSFORMS
from .transforms_file import TransformsFile as TransformsFile

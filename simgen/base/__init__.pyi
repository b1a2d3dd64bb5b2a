from . import random_streams as random_streams
from .file_lookup import AssetName as AssetName, EnvironmentName as EnvironmentName, ImageName as ImageName
from .file_lookup import LARGEST_FILE_BYTES as LARGEST_FILE_BYTES, LONGEST_NAME as LONGEST_NAME
from .file_lookup import MeshName as MeshName, asset as asset, cache_folder as cache_folder
from .file_lookup import cached as cached, check_installed as check_installed, find as find
from .file_lookup import find_all as find_all, named_files as named_files, not_installed as not_installed
from .strict_models import Colour as Colour, Count as Count, Direction as Direction, LARGEST_MM as LARGEST_MM
from .strict_models import LARGEST_TOML_BYTES as LARGEST_TOML_BYTES, LONGEST_PART as LONGEST_PART
from .strict_models import Length as Length, NonNegative as NonNegative, Position as Position
from .strict_models import Positive as Positive, Real as Real, Share as Share, Strict as Strict
from .strict_models import Title as Title, Vector as Vector, Whole as Whole
from .strict_models import read_toml as read_toml, shorten as shorten
from .strict_models import shown_value as shown_value, suggestion as suggestion, toml_text as toml_text
from .strict_models import validate as validate

from . import random_streams as random_streams
from .columns import join_rows as join_rows, take_rows as take_rows
from .file_lookup import asset as asset, AssetName as AssetName, cache_folder as cache_folder
from .file_lookup import cached as cached, check_installed as check_installed
from .file_lookup import EnvironmentName as EnvironmentName, find as find, find_all as find_all
from .file_lookup import ImageName as ImageName, LARGEST_FILE_BYTES as LARGEST_FILE_BYTES
from .file_lookup import LONGEST_NAME as LONGEST_NAME, MeshName as MeshName, named_files as named_files
from .file_lookup import not_installed as not_installed
from .strict_models import Colour as Colour, Count as Count, Direction as Direction, LARGEST_MM as LARGEST_MM
from .strict_models import LARGEST_TOML_BYTES as LARGEST_TOML_BYTES, Length as Length
from .strict_models import LONGEST_PART as LONGEST_PART, NonNegative as NonNegative, Position as Position
from .strict_models import Positive as Positive, read_toml as read_toml, Real as Real, Share as Share
from .strict_models import shorten as shorten, shown_value as shown_value, Strict as Strict
from .strict_models import suggestion as suggestion, Title as Title, toml_text as toml_text
from .strict_models import validate as validate, Vector as Vector, Whole as Whole

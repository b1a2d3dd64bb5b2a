from . import dataset_collection as dataset_collection, generation as generation
from .benchmark_making import certify as certify, Definition as Definition, load_definition as load_definition
from .benchmark_making import make_benchmark as make_benchmark
from .dataset_collection import generate_collection as generate_collection
from .generation import generate as generate
from .prepared import capture_of as capture_of, dark_map as dark_map, prepare as prepare
from .prepared import prepare_scene as prepare_scene, Prepared as Prepared, sensitivities as sensitivities
from .prepared import available_bytes as available_bytes, check_resources as check_resources
from .prepared import in_bytes as in_bytes, peak_bytes as peak_bytes, product_bytes as product_bytes
from .prepared import shortage as shortage
from .rendered_views import draw_counts as draw_counts, draw_from_views as draw_from_views
from .rendered_views import exact_view as exact_view, fixed_totals as fixed_totals
from .rendered_views import halved_view as halved_view, write_counts as write_counts

from . import methods as methods
from .explained_views import ExplainedViews as ExplainedViews
from .methods import BUILT_IN as BUILT_IN, check_range_mm as check_range_mm, check_search as check_search
from .methods import DEFAULT_METHOD as DEFAULT_METHOD, depth_methods as depth_methods
from .methods import depth_posterior as depth_posterior, estimate_depth as estimate_depth
from .methods import find_depth_method as find_depth_method, find_surfaces as find_surfaces
from .methods import FOR_COUNTS as FOR_COUNTS, FOR_VIEWS as FOR_VIEWS
from .network_inputs import hint_of as hint_of, NetworkInputs as NetworkInputs
from .network_inputs import surface_posterior as surface_posterior, SurfacePrior as SurfacePrior
from .posterior_depth import depth_map_of as depth_map_of, PosteriorDepth as PosteriorDepth
from .sheets import cut_sheets as cut_sheets, posterior_after as posterior_after, SheetModel as SheetModel
from .sheets import Sheets as Sheets
from .surface_network import run_network as run_network

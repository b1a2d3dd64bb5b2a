from . import methods as methods
from .methods import BUILT_IN as BUILT_IN, DEFAULT_METHOD as DEFAULT_METHOD, FOR_COUNTS as FOR_COUNTS
from .methods import FOR_VIEWS as FOR_VIEWS, check_range_mm as check_range_mm, check_search as check_search
from .methods import depth_methods as depth_methods, depth_posterior as depth_posterior
from .methods import estimate_depth as estimate_depth, find_depth_method as find_depth_method
from .methods import find_surfaces as find_surfaces
from .explained_views import ExplainedViews as ExplainedViews
from .network_inputs import NetworkInputs as NetworkInputs, SurfacePrior as SurfacePrior
from .network_inputs import hint_of as hint_of, surface_posterior as surface_posterior
from .posterior_depth import PosteriorDepth as PosteriorDepth, depth_map_of as depth_map_of
from .sheets import SheetModel as SheetModel, Sheets as Sheets, cut_sheets as cut_sheets
from .sheets import posterior_after as posterior_after
from .surface_network import run_network as run_network

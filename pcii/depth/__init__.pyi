from . import methods as methods
from .depth_planes import check_range_mm as check_range_mm, check_search as check_search
from .methods import BUILT_IN as BUILT_IN, DEFAULT_METHOD as DEFAULT_METHOD, FOR_COUNTS as FOR_COUNTS
from .methods import FOR_VIEWS as FOR_VIEWS, depth_methods as depth_methods
from .methods import depth_posterior as depth_posterior, estimate_depth as estimate_depth
from .methods import find_depth_method as find_depth_method, find_surfaces as find_surfaces
from .network_inputs import NetworkInputs as NetworkInputs
from .posterior_depth import PosteriorDepth as PosteriorDepth, depth_map_of as depth_map_of
from .sheets import SheetModel as SheetModel
from .smooth_surface import SurfacePrior as SurfacePrior, surface_posterior as surface_posterior
from .surface_network import run_network as run_network

from . import backend as backend
from .backend import doubles as doubles, floats as floats, gathered as gathered, is_scalar as is_scalar
from .backend import load_drjit as load_drjit, opaque as opaque, signed as signed, unsigned as unsigned
from .backend import whole as whole
from .emission import light_spectrum as light_spectrum, ShiningSurface as ShiningSurface
from .light_tracing import Arrivals as Arrivals, LampTracer as LampTracer
from .mitsuba_reference import reference_to as reference_to
from .mitsuba_scene import build as build, RenderScene as RenderScene, rows_of as rows_of
from .path_tracing import bright_directions as bright_directions, film_rays as film_rays
from .path_tracing import FirstHits as FirstHits, PathTracer as PathTracer
from .path_tracing import surrounding_radiance as surrounding_radiance
from .radiance import render_view as render_view, sensor_plugin as sensor_plugin
from .radiance import windows_of_objects as windows_of_objects
from .ray_states import light_of as light_of, RandomNumbers as RandomNumbers, streams_for as streams_for

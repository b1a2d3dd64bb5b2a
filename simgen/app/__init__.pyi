from .library import Executor as Executor
from .library import generate as generate
from .library import draw_photons as draw_photons, generate_collection as generate_collection
from .library import load_scene as load_scene, render as render
from .pictures import preview as preview
from .scene_commands import new_recipe as new_recipe, new_scene as new_scene

from .in_memory import draw_photons as draw_photons, render as render
from .library import Executor as Executor, generate as generate, generate_collection as generate_collection
from .library import load_scene as load_scene, preview as preview
from .starting_points import list_recipes as list_recipes, list_scenes as list_scenes
from .starting_points import write_new_recipe as write_new_recipe, write_new_scene as write_new_scene

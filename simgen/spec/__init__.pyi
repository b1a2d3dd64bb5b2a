from . import lights as lights, scene_lookup as scene_lookup
from .lights import AreaLight as AreaLight, DirectionalLight as DirectionalLight
from .lights import EnvironmentLight as EnvironmentLight, Illuminant as Illuminant, Level as Level
from .lights import Light as Light, PointLight as PointLight, SpotLight as SpotLight
from .lights import UniformLight as UniformLight
from .materials import Checks as Checks, Edge as Edge, Emission as Emission, Glass as Glass
from .materials import LEAST_INDEX as LEAST_INDEX, MOST_INDEX as MOST_INDEX, Material as Material
from .materials import Matt as Matt, Metal as Metal, Noise as Noise, Plastic as Plastic
from .materials import Principled as Principled, Reflectance as Reflectance, Spectrum as Spectrum
from .materials import Star as Star, Stripes as Stripes, Text as Text, Texture as Texture
from .materials import is_clear as is_clear
from .mitsuba_file import MitsubaFile as MitsubaFile, MitsubaXml as MitsubaXml, OF_RECIPES as OF_RECIPES
from .recipe import Analysis as Analysis, CalibrationErrors as CalibrationErrors, Exposure as Exposure
from .recipe import FullLight as FullLight, Grid as Grid, Lens as Lens, MOST_PATHS as MOST_PATHS
from .recipe import MOST_PHOTONS as MOST_PHOTONS, Photons as Photons, Products as Products
from .recipe import Publication as Publication, Recipe as Recipe, Render as Render, Sensor as Sensor
from .recipe import ViewPass as ViewPass
from .recipe_files import RecipeFile as RecipeFile, load_recipe as load_recipe, override as override
from .recipe_files import Sweep as Sweep, load_sweep as load_sweep, recipe_file as recipe_file
from .recipe_files import recipe_names as recipe_names
from .scene import Backdrop as Backdrop, Box as Box, Card as Card, Cylinder as Cylinder
from .scene import MOST_OBJECTS as MOST_OBJECTS, Mesh as Mesh, NAME as NAME, Scene as Scene
from .scene import SceneObject as SceneObject, Shape as Shape, Sphere as Sphere
from .scene import check_unscored as check_unscored, checked_folder as checked_folder
from .scene import names_of_objects as names_of_objects, scene_files as scene_files, scene_of as scene_of
from .scene_lookup import drawn_scenes as drawn_scenes, is_drawn as is_drawn, is_scene as is_scene
from .scene_lookup import load_scene as load_scene, scene_names as scene_names

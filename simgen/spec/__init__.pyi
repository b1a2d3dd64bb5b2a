from . import lights as lights, scene_lookup as scene_lookup
from .lights import AreaLight as AreaLight, DirectionalLight as DirectionalLight
from .lights import EnvironmentLight as EnvironmentLight, Illuminant as Illuminant, Level as Level
from .lights import Light as Light, PointLight as PointLight, SpotLight as SpotLight
from .lights import UniformLight as UniformLight
from .materials import Checks as Checks, Edge as Edge, Emission as Emission, Glass as Glass
from .materials import is_clear as is_clear, LEAST_INDEX as LEAST_INDEX, Material as Material, Matt as Matt
from .materials import Metal as Metal, MOST_INDEX as MOST_INDEX, Noise as Noise, Plastic as Plastic
from .materials import Principled as Principled, Reflectance as Reflectance, Spectrum as Spectrum
from .materials import Star as Star, Stripes as Stripes, Text as Text, Texture as Texture
from .mitsuba_file import MitsubaFile as MitsubaFile, MitsubaXml as MitsubaXml, OF_RECIPES as OF_RECIPES
from .recipe import Analysis as Analysis, CalibrationErrors as CalibrationErrors, Exposure as Exposure
from .recipe import FullLight as FullLight, Grid as Grid, Lens as Lens, MOST_PATHS as MOST_PATHS
from .recipe import MOST_PHOTONS as MOST_PHOTONS, Photons as Photons, Products as Products
from .recipe import Publication as Publication, Recipe as Recipe, Render as Render, Sensor as Sensor
from .recipe import ViewPass as ViewPass
from .recipe_files import load_recipe as load_recipe, load_sweep as load_sweep, override as override
from .recipe_files import recipe_file as recipe_file, recipe_names as recipe_names, RecipeFile as RecipeFile
from .recipe_files import Sweep as Sweep
from .scene import Backdrop as Backdrop, Box as Box, Card as Card, check_unscored as check_unscored
from .scene import checked_folder as checked_folder, Cylinder as Cylinder, Mesh as Mesh
from .scene import MOST_OBJECTS as MOST_OBJECTS, NAME as NAME, names_of_objects as names_of_objects
from .scene import Scene as Scene, scene_files as scene_files, scene_of as scene_of
from .scene import SceneObject as SceneObject, Shape as Shape, Sphere as Sphere
from .scene_lookup import drawn_scenes as drawn_scenes, is_drawn as is_drawn, is_scene as is_scene
from .scene_lookup import load_scene as load_scene, scene_names as scene_names

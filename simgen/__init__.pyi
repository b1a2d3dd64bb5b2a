__version__: str
__all__: list[str]

from .app.library import Executor as Executor, draw_photons as draw_photons, generate as generate
from .app.library import generate_collection as generate_collection, load_scene as load_scene
from .app.library import render as render
from .app.pictures import preview as preview
from .importing.scene_import import ImportedScene as ImportedScene, import_scene as import_scene
from .spec.lights import AreaLight as AreaLight, DirectionalLight as DirectionalLight
from .spec.lights import EnvironmentLight as EnvironmentLight, Level as Level, PointLight as PointLight
from .spec.lights import SpotLight as SpotLight, UniformLight as UniformLight
from .spec.materials import Checks as Checks, Edge as Edge, Emission as Emission, Glass as Glass
from .spec.materials import Material as Material, Matt as Matt, Metal as Metal, Noise as Noise
from .spec.materials import Plastic as Plastic, Principled as Principled, Spectrum as Spectrum, Star as Star
from .spec.materials import Stripes as Stripes, Text as Text
from .spec.recipe import CalibrationErrors as CalibrationErrors, Lens as Lens, Sensor as Sensor
from .spec.recipe_files import RecipeFile as RecipeFile, load_recipe as load_recipe
from .spec.scene import Backdrop as Backdrop, Box as Box, Card as Card, Cylinder as Cylinder, Mesh as Mesh
from .spec.scene import Scene as Scene, SceneObject as SceneObject, Sphere as Sphere

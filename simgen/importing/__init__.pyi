from .scene_import import ImportedScene as ImportedScene, import_scene as import_scene

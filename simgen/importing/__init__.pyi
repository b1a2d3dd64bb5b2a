from .scene_import import import_scene as import_scene, ImportedScene as ImportedScene

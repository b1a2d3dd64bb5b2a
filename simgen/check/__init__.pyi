from .scene_probe import Facts as Facts, Finding as Finding, ObjectFacts as ObjectFacts
from .scene_probe import probe_scene as probe_scene
from .targets import findings as findings, lint as lint, load_target as load_target

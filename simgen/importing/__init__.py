"""Scenes of other programs: glTF files and meshes are translated, Mitsuba scenes referred to."""

"""Scenes of other programs: a glTF file translated into a scene of ours, a Mitsuba scene by reference.

gltf_document   The JSON of a glTF file: what is read of it, as models that check it, and names of the rest.
gltf_file       A glTF file and the arrays and pictures that it names.
gltf_materials  Materials of a glTF file as ours, in numbers and pictures.
gltf_scene      The nodes, meshes, cameras and lights of a glTF file, and where its scene stands in ours.
scene_import    From a scene file of another program to a scene's folder.
"""

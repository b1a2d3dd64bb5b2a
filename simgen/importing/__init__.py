"""Scenes of other programs: glTF files and meshes are translated, Mitsuba scenes referred to.

foreign_scene   A scene of another program: objects, lamps, cameras, and where it stands in ours.
gltf_document   The JSON of a glTF file: what is read of it, as models that check it, and names of the rest.
gltf_file       A glTF file and the arrays and pictures that it names.
gltf_materials  Materials of a glTF file as ours, in numbers and pictures.
gltf_scene      The nodes, meshes, cameras and lights of a glTF file.
mesh_scene      Files of meshes alone: OBJ by groups and materials, STL by solids, PLY.
scene_import    From a scene file of another program to a scene's folder.
"""

"""Scenes of other programs: a glTF file translated into a scene of ours, a Mitsuba scene by reference.

foreign_scene   What a scene file of another program says, in its own axes and unit, and where it stands in
                ours.
gltf_document   The JSON of a glTF file: what of it is read, as models that check it, and the names of what is
                not.
gltf_file       A glTF file and the arrays and pictures that it names (sections 3.6 and 4.4 of the
                specification).
gltf_materials  Materials of a glTF file as ours: what its metallic-roughness model says in numbers and
                pictures.
gltf_scene      A glTF file as a foreign scene: its nodes, meshes, cameras and lights (sections 3.5 to 3.10).
scene_import    From a scene file of another program to a scene's folder.
"""

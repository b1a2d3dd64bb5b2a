"""Scenes of other programs: a glTF file translated into a scene of ours, a Mitsuba scene by reference.

foreign_scene   What a scene file of another program says, in its own axes and unit, and where it stands in
                ours.
gltf_arrays     Arrays of numbers and triangles of a glTF file (sections 3.6 and 3.7 of the specification).
gltf_file       A glTF file and the bytes that it names: JSON or its binary form, checked before anything is
                made of it.
gltf_materials  Materials of a glTF file as ours: what its metallic-roughness model says in numbers and
                pictures.
gltf_models     What of a glTF file's JSON is read, as models that check it.
gltf_scene      A glTF file as a foreign scene: its nodes, meshes, cameras and lights (sections 3.5 to 3.10).
scene_import    From a scene file of another program to a scene's folder.
"""

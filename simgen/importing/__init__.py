"""Scenes of other programs as our own.

fitted_materials   What a material needs of the mesh that it is on: pictures that are repeated, shine, or
                   leave holes.
foreign_scene      What a scene file of another program says, in its own axes and unit.
gltf_materials     Materials of a glTF file as ours: what its metallic-roughness model says in numbers and
                   pictures.
gltf_pictures      Pictures that a glTF file names or holds, decoded in a process that may die.
gltf_scene         A glTF file as a foreign scene: its nodes, meshes, cameras and lights (sections 3.5 to
                   3.10).
mitsuba_finishes   Bsdfs of Mitsuba as the colour and finish of our materials.
mitsuba_lights     Emitters of Mitsuba that are no surfaces, as our lights.
mitsuba_materials  Surfaces of a Mitsuba scene as our materials: finish, holes, tilts, and the light that they
                   send out.
mitsuba_objects    A Mitsuba scene as a foreign scene: its shapes, lights and cameras.
mitsuba_pictures   What one surface of a Mitsuba scene takes from its textures: pictures in one layout, or
                   their means.
placement          Where a foreign scene stands: before one of its own cameras, or at a place and of a size
                   that are given.
scene_folder       A foreign scene as a folder of its own: scene.toml, meshes as PLY, pictures as PNG and
                   OpenEXR.
scene_import       From a scene file of another program to a scene's folder.
turned_images      Images of what shines from all around, turned with the scene.
"""

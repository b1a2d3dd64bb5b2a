"""A scene's files, decoded in a process that may die and checked; solids and patterns made here.

asset_files     Files that a scene brings along, as plain arrays: decoded in a process of their own that
                may die.
asset_worker    The process that decodes strangers' files: whatever they do to it, the parent lives.
cutouts         Surfaces with holes: what an image of opacity leaves of a mesh, as a mesh.
image_files     Pictures of strangers: textures as 8 or 16 bit sRGB, environments as linear radiance.
mesh_points     Points that are spread over a mesh, and whether each part of a picture lies on it once.
obj_files       Wavefront OBJ meshes: polygons with normals and texture coordinates; no other file is ever
                opened.
pattern_areas   Exact means of sharp and smooth patterns over rectangular pixels.
ply_files       PLY meshes: text or binary of either byte order, polygons, normals and texture
                coordinates.
solids          Shapes as triangles about their position, each face with its own part of the picture.
texture_pixels  Textures as pixels: linear reflectance, with every border antialiased by area in linear
                light.
triangles       Triangles with what a renderer needs of them: checked arrays, whoever made them.
"""

"""A scene's files, decoded and checked once; solids and patterns made here.

asset_files     Files that a scene brings along, as plain arrays that are checked once, before the renderer
                sees them.
cutouts         Surfaces with holes: what an image of opacity leaves of a mesh, as a mesh.
mesh_files      Mesh files as checked triangles: PLY as plyfile reads it, Wavefront OBJ, and PLY written.
mesh_points     Points that are spread over a mesh, and whether each part of a picture lies on it once.
solids          Shapes as triangles about their position, each face with its own part of the picture.
texture_pixels  Textures as pixels: linear reflectance, with every border antialiased by area in linear
                light.
triangles       Triangles with what a renderer needs of them: checked arrays, whoever made them.
"""

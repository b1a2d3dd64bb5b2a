"""A scene's files, decoded and checked once; shapes and patterns as arrays.

asset_files     Pictures and meshes that a scene brings along, as plain arrays.
cutouts         Surfaces with holes: what an image of opacity leaves of a mesh, as a mesh.
texture_pixels  Patterns as pixels: linear reflectance, antialiased by area.
triangles       Triangle meshes: checked arrays, shapes as triangles, points on a surface.
"""

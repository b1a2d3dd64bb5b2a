from .asset_files import Assets as Assets, obj_parts as obj_parts, ply_bytes as ply_bytes
from .asset_files import read_assets as read_assets, read_mesh as read_mesh, read_texture as read_texture
from .cutouts import cut_out as cut_out, FULL as FULL
from .texture_pixels import paint as paint
from .triangles import across_faces as across_faces, bears_pictures_once as bears_pictures_once, box as box
from .triangles import card_triangles as card_triangles, cylinder as cylinder, globe as globe
from .triangles import MOST_FACES as MOST_FACES, MOST_VERTICES as MOST_VERTICES
from .triangles import surface_points as surface_points, Triangles as Triangles, triangles_of as triangles_of

from .asset_files import Assets as Assets, obj_parts as obj_parts, ply_bytes as ply_bytes
from .asset_files import read_assets as read_assets, read_mesh as read_mesh, read_texture as read_texture
from .cutouts import FULL as FULL, cut_out as cut_out
from .texture_pixels import paint as paint
from .triangles import MOST_FACES as MOST_FACES, MOST_VERTICES as MOST_VERTICES, Triangles as Triangles
from .triangles import bears_pictures_once as bears_pictures_once, box as box
from .triangles import card_triangles as card_triangles, cylinder as cylinder, globe as globe
from .triangles import surface_points as surface_points, triangles_of as triangles_of

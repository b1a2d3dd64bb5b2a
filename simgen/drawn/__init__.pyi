from .kinds import FIRST_UNSEEN as FIRST_UNSEEN
from .training_kinds import GAP_PX as GAP_PX, TOTAL_PX_MM as TOTAL_PX_MM
from .parts import blob as blob, head as head, mesh_folder as mesh_folder, mesh_of as mesh_of
from .parts import spindle as spindle, tube as tube

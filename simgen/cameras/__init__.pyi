from .disparities import apart_px as apart_px, disparities_px as disparities_px
from .disparities import mending_pitch_mm as mending_pitch_mm, share_seen_by_all as share_seen_by_all
from .disparities import shares_without as shares_without, spread_px_mm as spread_px_mm
from .rig import Camera as Camera, Cameras as Cameras, Rig as Rig, as_rig as as_rig
from .rig import centre_camera as centre_camera, coarser as coarser, corners as corners, rig_of as rig_of

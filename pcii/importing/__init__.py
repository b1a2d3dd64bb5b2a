"""Images made by others: pictures, light field benchmarks, arrays, lens arrays, photon counts.

array_files     Elemental images in NumPy arrays and files: (K, L, H, W) or (K, L, H, W, C).
camera_order    Cameras of imported images: their optics, and the order in which the views were stored.
count_frames    Photon counts of real detectors: arrays, or stacks of frames, of one bit each or more,
                added up.
exported_files  Files that `simgen export` writes and that say themselves which cameras saw them:
                events.npz, views.exr.
file_patterns   Files of views by names: a pattern with {row} and {col}, or with {index}, and the files
                that fit it.
grid_check      Whether views fit the cameras that were told: where they are sharp, and which mistake
                explains them better.
hci_scenes      Scenes of the HCI 4D light field benchmark (Honauer et al. 2016): views, cameras and true
                depth.
image_folders   Elemental images from a folder of pictures, one file a view.
import_advice   How an import is to be mended if its views do not fit the cameras that were told, in words of
                options.
import_requests What an import is asked for, and what is read of it: which kind of source it is, and what goes
                with it.
lens_arrays     Pictures of a lens array: one picture that holds the elemental images of all lenses side
                by side.
light_encoding  Linear radiance from the numbers of picture files: sRGB, a gamma, or linear already.
posed_pictures  Pictures with the poses of their cameras: transforms.json as nerfstudio and its kin write it.
plane_sweep     How well views agree at each of many depths: a plane sweep at reduced resolution.
"""

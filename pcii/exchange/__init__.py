"""What comes in and goes out: images made by others are read, datasets are written for other tools.

camera_fit       Do views fit the stated cameras? Where they are sharp, and which order or shift does.
count_arrays     Arrays of light and of photon counts, and stacks of frames of counts that are added up.
dataset_card     README.md of a dataset or collection: what it is, how to open it, and under what terms it
                 may be used.
export_formats   The formats that datasets are written in, by name; and those of single photons: events
                 and photon cubes.
export_hci       The layout of the 4D Light Field Benchmark of Konstanz and Heidelberg (Honauer et al.,
                 ACCV 2016).
export_pictures  Pictures of 8 bits of all views, and the folder of pictures and poses for nerfstudio.
hci_scenes       Scenes of the HCI 4D light field benchmark (Honauer et al. 2016).
image_folders    Elemental images from pictures: a folder with a file a view, a TIFF file with a page a view.
import_requests  A reader for each kind of source, whose parameters are the options that go with it.
lens_arrays      Pictures of a lens array, cut apart.
photon_cubes     Frames of one bit a pixel, in NumPy files that may be larger than memory.
pixel_files      Picture files as arrays, and the light that their numbers stand for.
posed_views      Pictures and photon cubes with the poses of their cameras, which are of one plane grid.
transforms_file  The file transforms.json of neural reconstruction, read and checked.
"""

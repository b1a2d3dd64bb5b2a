"""What comes in and goes out: images made by others are read, datasets are written for other tools.

array_files      Arrays in files of NumPy, MATLAB and HDF5.
count_arrays     Arrays of light and of photon counts, and photon cubes, whose frames are added up.
depth_files      A map of true depth as the truth of imported views.
export_command   The command `export` of `pcii` and `simgen`.
export_formats   The formats that datasets are written in, by name; and those of single photons: events
                 and photon cubes.
export_pictures  Pictures of 8 bits of all views, and the folder of pictures and poses for nerfstudio.
frame_formats    How files keep the frames of a photon counter, and what looks wrong in them.
hci_scenes       The layout of the HCI 4D light field benchmark (Honauer et al. 2016), read and written.
image_folders    Elemental images from pictures: a file a view, a page a view, a picture of a lens array.
import_requests  Which reader takes a source, and which options go with it.
pixel_files      Picture files as arrays, and the light that their numbers stand for.
posed_views      Pictures with the poses of their cameras, which are of one plane grid.
stated_cameras   Where cameras stand, how they see, and in which order views are stored.
transforms_file  The file transforms.json of neural reconstruction, read and checked.
"""

"""Datasets in the file formats of other people's tools.

dataset_card         README.md of a dataset or collection: what it is, how to open it, and under what terms
                     it may be used.
event_archive        Photon events, camera grid and truth in one NumPy archive.
export_formats       The formats that datasets can be written in, by name, and the folder that is
                     written.
exr_parts            One OpenEXR file: a part for each view with its radiance and photons, and one with
                     the truth.
hci_layout           The layout of the 4D Light Field Benchmark of Konstanz and Heidelberg (Honauer et
                     al., ACCV 2016).
nerfstudio_folder    Pictures with the poses of their cameras, as nerfstudio and its kin read them.
photon_cubes         Binary frames of every view, eight pixels in a byte, with the poses of the cameras.
sub_aperture_images  Sub-aperture images: a PNG for each view, named by row and column of its camera, and
                     the cameras as JSON.
view_names           Names of views in files: camera (k, l) with as many digits as the grid needs, so that
                     they sort.
view_pictures        Pictures of 8 bits of a dataset's views, of one white for all.
"""

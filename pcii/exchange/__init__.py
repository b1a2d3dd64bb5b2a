"""What goes out to other programs: datasets in their file formats.

export_formats   The formats by name, and the folder that a dataset or collection is written to.
export_hci       The layout of the 4D Light Field Benchmark of Konstanz and Heidelberg (Honauer et al.,
                 ACCV 2016).
export_photons   Photons one by one: events in a NumPy archive, and photon cubes of binary frames.
export_pictures  Pictures of 8 bits of all views, and the folder of pictures and poses for nerfstudio.
"""

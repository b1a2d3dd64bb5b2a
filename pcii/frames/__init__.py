"""Frames of single-photon cameras in NumPy files, which are read piece by piece: larger than memory.

binary_frames   Frames of one bit a pixel, eight pixels in a byte: their sums, and the places of set bits.
cube_folders    Photon cubes of many cameras, or of one, that a transforms.json places.
frame_files     The frames of a view in a NumPy file, packed or not.
frame_sums      Photon counts of binary frames of all views: sums, and the single counts if they are few.
"""

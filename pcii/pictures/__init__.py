"""Picture files of everybody, read with limits, and those that are written for other tools.

array_headers   Headers of NumPy files, read and checked before any number is.
exr_files       Channels of OpenEXR files, part by part, whose sizes their headers tell first.
picture_files   One picture file to an array: PNG, JPEG, TIFF, EXR and PFM, of up to 16 bits or of floats.
tiff_pages      Pages of TIFF files: grey, RGB or palettes, of up to 16 bits or of floats.
written_pixels  Files of pixels that other tools read: PNG of 8 and 16 bits, PFM.
"""

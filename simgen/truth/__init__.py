"""What is true of a scene: depth, objects, normals, coverage of pixels, visible cameras, and their file.

first_hits  First hits of pixels: depth, object, normal, coverage of the pixel, cameras that see them.
truth_file  The truth of a dataset on disk: every pass at the virtual centre, and of every view on request.
"""

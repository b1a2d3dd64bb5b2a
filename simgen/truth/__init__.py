"""What is true of a scene: depth, objects, normals, coverage of pixels, visible cameras, and their file."""

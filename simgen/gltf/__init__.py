"""glTF 2.0 files as plain values: checked models, arrays of numbers and triangles.

gltf_arrays    Arrays of numbers and triangles of a glTF file (sections 3.6 and 3.7 of the specification).
gltf_file      A glTF file and the bytes that it names: JSON or its binary form, checked before anything is
               made of it.
gltf_models    What of a glTF file's JSON is read, as models that check it.
gltf_surfaces  What glTF calls materials, textures and images, as models that check it.
"""

"""Scene files of Mitsuba, read as plain values; nothing in them is ever run.

mitsuba_contents    Files that the shapes and lights of a Mitsuba scene name, read once each.
mitsuba_drafts      Mitsuba scene files as plugins that refer to each other: includes, defaults and old
                    names.
mitsuba_files       Files of one Mitsuba scene: found only inside its folder, and XML read under limits.
mitsuba_plugins     The plugins of Mitsuba that can be imported, with their parameters and defaults.
mitsuba_reader      A Mitsuba scene file as checked plugins; what cannot be imported is named.
mitsuba_references  Plugins of Mitsuba as they are written, and what they are once references among them are
                    followed.
mitsuba_scene       What a Mitsuba scene file says: nested plugins with checked parameters.
mitsuba_substances  Substances that Mitsuba knows by name: refractive indices, and the colours of metals.
mitsuba_textures    Colours, spectra and textures of a Mitsuba scene: sRGB, tables by wavelength, pictures and
                    grey numbers.
mitsuba_triangles   Shapes of Mitsuba as triangles, with its texture coordinates, and normals as it makes them
                    for meshes.
mitsuba_values      Values in Mitsuba scene files: numbers, vectors, colours, spectra and transforms.
"""

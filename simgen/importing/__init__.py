"""Scene files of other programs, read as plain values; nothing in them is ever run.

mitsuba_drafts      Elements of Mitsuba scene files as nested plugins: includes, defaults and references
                    followed.
mitsuba_files       Files of one Mitsuba scene: found only inside its folder, and XML read under limits.
mitsuba_plugins     The plugins of Mitsuba that can be imported, with their parameters and defaults.
mitsuba_scene       What a Mitsuba scene file says: nested plugins with checked parameters.
mitsuba_values      Values in Mitsuba scene files: numbers, vectors, colours, spectra and transforms.
mitsuba_xml         A Mitsuba scene file as checked plugins; what cannot be imported is named.
"""

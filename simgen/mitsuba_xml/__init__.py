"""Scene files of Mitsuba, read as plain values; nothing in them is ever run.

mitsuba_drafts      Mitsuba scene files as plugins that refer to each other: includes, defaults and old
                    names.
mitsuba_files       Files of one Mitsuba scene: found only inside its folder, and XML read under limits.
mitsuba_plugins     The plugins of Mitsuba that can be imported, with their parameters and defaults.
mitsuba_reader      A Mitsuba scene file as checked plugins; what cannot be imported is named.
mitsuba_references  Plugins of Mitsuba as they are written, and what they are once references among them are
                    followed.
mitsuba_scene       What a Mitsuba scene file says: nested plugins with checked parameters.
mitsuba_values      Values in Mitsuba scene files: numbers, vectors, colours, spectra and transforms.
"""

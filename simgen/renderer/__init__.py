"""The one room that knows Mitsuba: backends, scenes, light paths, radiance.

backend           The renderer behind everything: the one place that loads Mitsuba and Dr.Jit.
device_arrays     NumPy's arrays as the renderer's, and parts of those; for compiled backends.
emission          Objects that shine by themselves: as Mitsuba's emitters, and the light that they give a
                  plane.
intersection      Rays by the million, NumPy in and NumPy out: all at once in compiled modes, one by one
                  in scalar mode.
mitsuba_camera    Cameras as Mitsuba's: its sensors, and rays through points of their films.
mitsuba_lights    Lights as Mitsuba's emitters, and how bright they make a plane.
mitsuba_reference A Mitsuba scene by reference: its own parser reads it, and Mitsuba builds all that it
                  names, as it stands.
mitsuba_scene     From a validated scene to Mitsuba's: we alone choose the plugins, a scene file never
                  names one.
mitsuba_shapes    Shapes as Mitsuba's: its own sphere and rectangle, and meshes built in memory, never
                  from a file.
mitsuba_surfaces  Materials as Mitsuba's surfaces, colours and spectra as its textures, in the variant that is
                  set.
path_tracing      Light paths, one for each of many camera rays at once: what is hit first, and unbiased
                  radiance.
radiance          Dense radiance of one view: every pixel, by path tracing.
world_frame       The renderer's own axes and unit of length, which are those of a Mitsuba file if the scene
                  refers to one.
wavelengths       How rays carry light, for compiled backends: as three colours, or as four wavelengths
                  for a pixel's filter.
"""

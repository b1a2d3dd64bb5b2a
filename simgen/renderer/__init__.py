"""The one room that knows Mitsuba: backends, scenes, light paths, radiance.

backend           The renderer behind everything: the one place that loads Mitsuba and Dr.Jit, and gives
                  arrays to them.
emission          What shines: lamps and objects as Mitsuba's emitters, and the light that they give a plane.
intersection      Rays by the million, NumPy in and NumPy out.
light_tracing     Light followed from lamps: what of it mirrors and glass send to the cameras.
mitsuba_reference A Mitsuba scene by reference: Mitsuba builds all that the file names, as it stands.
mitsuba_scene     From a validated scene to Mitsuba's: only this package names plugins, never a scene file.
mitsuba_shapes    Where things stand in the renderer's axes, and their shapes.
mitsuba_surfaces  Materials as Mitsuba's surfaces, colours and spectra as its textures.
path_tracing      Camera rays and light paths, many at once: what is hit first, and unbiased radiance.
radiance          Dense radiance of one view: cameras as Mitsuba's sensors, every pixel by path tracing.
random_numbers    Random numbers of light paths: a stream in each lane, of a seed of any size.
wavelengths       How rays carry light: as three colours, or as four wavelengths for a pixel's filter.
"""

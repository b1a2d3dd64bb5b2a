"""The one room that knows Mitsuba: backends, scenes, light paths, radiance."""

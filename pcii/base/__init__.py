"""Tools that know nothing of cameras: errors, progress, commands, compiled loops, sRGB."""

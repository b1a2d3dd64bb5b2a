"""Blender runs the script that exports its scene; it is no module of the tests."""

collect_ignore = ["by_blender"]

"""Removal of defocused points: methods by name, and those of other packages."""

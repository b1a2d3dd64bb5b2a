"""Sections of the scene: Eqs. 2 and 3 from events and from images, demosaicing (Eqs. 4-6), statistics."""

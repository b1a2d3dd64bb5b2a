"""Textbook methods of depth and of removal to compare others with, loaded when asked for by name."""

"""Removal of defocused points: methods by name, simple ones, and those of other packages.

methods         Removal of defocused points: which points of each section are in focus there.
plugins         Removal methods that other packages bring: entry points of the group `pcii.methods`.
simple_methods  Removal as textbooks would do it: by brightness, by variance, by sharpness. To compare
                others with.
"""

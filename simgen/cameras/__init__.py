"""Where cameras stand and which way their pixels look; disparities.

disparities  What a camera grid does to depth: disparities, whole-pixel shifts, and colours that meet.
rig          Where cameras really stand and which way their pixels look, from first principles.
"""

"""Where cameras stand and which way their pixels look; disparities.

calibration  How far the cameras of a recipe are off their places, and how they are turned: errors of
             calibration.
disparities  What a camera grid does to depth: disparities, whole-pixel shifts, and colours that meet.
rig          Where the cameras stand and which way pixels look, from first principles.
"""

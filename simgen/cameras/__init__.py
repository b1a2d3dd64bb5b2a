"""Where cameras stand and which way their pixels look; disparities.

calibration  How far the cameras of a recipe are off their places, and how they are turned: errors of
             calibration.
chief_rays   Which way a point of the film looks: one formula, for NumPy's arrays and for the renderer's
             alike.
disparities  What a camera grid does to depth: disparities, whole-pixel shifts, and colours that meet.
film_windows  Rectangles of a film that objects can be seen in.
rig          Where the cameras stand and which way pixels look, from first principles.
"""

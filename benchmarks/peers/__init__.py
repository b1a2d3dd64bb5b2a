"""What ours is compared with, written as a good user of other packages would write it.

dense_photons    Photon counts by rendering all pixels and drawing from them.
plain_pipeline   The main job in one script of Mitsuba, NumPy and SciPy.
shifted_means    Sections as means of shifted images by SciPy, OpenCV and NumPy.
"""

"""Pictures of scenes and of datasets.

contact_sheet    A contact sheet of a finished dataset: its truth, its photons and its full-light images
                 on one page.
picture_parts    Parts of the pictures of `preview` and `sheet`: where to look, depth, objects by name,
                 and the file.
preview_picture  A quick look at a scene: the picture, depth and objects that the virtual centre camera
                 sees.
thumbnails       Small pictures of many views: photons binned so that they can be seen, full-light views
                 averaged.
"""

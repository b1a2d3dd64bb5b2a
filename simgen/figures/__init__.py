"""Pictures of scenes and of datasets.

contact_sheet    A contact sheet of a finished dataset: its truth, its photons and its full-light images
                 on one page.
picture_parts    Parts of the pictures of `preview` and `sheet`: where to look, depth and objects, and the
                 file.
preview_picture  A quick look at a scene: the picture, depth and objects that the virtual centre camera
                 sees.
thumbnails       Small pictures of many views at one exposure: photons in blocks so that they can be seen,
                 full light.
"""

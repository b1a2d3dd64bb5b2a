"""Plain image tools without photons in them: outlines, bright regions, watersheds, pictures.

bright_regions    Where a section is bright: an outline that runs along the strongest edges.
mask_outlines     Outlines of masks, located within pixels, and how well two of them agree.
pictures          Pictures of sections, masks and depth: linear values to 8-bit sRGB, cropped to what
                  matters.
watershed_pieces  Cut what is bright into pieces along the ridges of its edges, and give each piece one
                  plane.
"""

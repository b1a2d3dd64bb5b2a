"""Image processing: blocks, bright regions, outlines, watersheds.

blocks            Square blocks of pixels: sums over them, and their values on pixels again; windows;
                  some of many things.
bright_regions    Bright regions of a section, with outlines along the strongest edges; operations on
                  masks.
mask_outlines     Outlines of masks with subpixel accuracy, and their agreement.
watershed_pieces  Division of bright regions into pieces along the ridges of edges, and the choice of a
                  plane for each piece.
"""

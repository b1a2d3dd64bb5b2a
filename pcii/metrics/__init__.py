"""How right an estimate is: masks, depth, photons and bounds; nothing here knows a method.

agreement       How well two masks agree, and whether the photons that a method keeps are the right ones.
bounds          How good it could be: masks from the true depth, and how well photons can tell depth at
                all.
depth_accuracy  Errors of a depth map: in mm, in px of total disparity, and by the 4D light field
                benchmark.
scoring         How right it was: masks, depth and entropies against the truth.
true_masks      What should be in focus in each section: the truth as masks, by object and by pixel.
"""

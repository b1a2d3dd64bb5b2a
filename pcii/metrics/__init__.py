"""Accuracy of estimates: masks, depth and photons against the truth, and bounds; independent of methods.

bounds          Bounds on accuracy: masks from the true depth, and the Cramér-Rao bound on depth from
                photons.
depth_accuracy  Errors of a depth map, in mm, px and by the 4D light field benchmark, and whether its
                confidence is right.
scoring         Scores of masks, depth and entropies against the truth.
true_masks      True in-focus masks of sections, by object and by pixel, and how well a mask and its
                photons agree with them.
"""

"""Accuracy of estimates: masks, depth and photons against the truth, and bounds; independent of methods."""

"""Depth of each pixel, with its probability.

Evidence becomes a posterior by the smoothness of surfaces and a network; sheets cut from it explain the
photons of all cameras.
"""

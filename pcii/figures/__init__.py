"""Pictures of plain arrays: 8-bit images, and what Matplotlib draws for `.plot()` and notebooks.

Functions take plain arrays; one module knows by the name of a type what of it is worth a picture.

Every `.plot(axes=None, ...)` draws into the Matplotlib axes that it is given, or else into a new figure of
`pyplot`, and returns them as an array (N,), one for each panel; it takes them as a list, one panel's alone
too. Matplotlib is imported on the first picture.

charts        Charts: camera positions, probability over depth, bars of shares, reliability of confidence.
drawn_types   What each type shows of itself: `.plot()` of all, and their page in notebooks.
exposure      What of an image is shown, and how bright: blocks, smoothed photons, means, a common
              exposure.
maps          Maps over pixels with a scale: depth, entropy.
object_maps   Objects in colours, with their names beside the picture.
palette       Colours and markers that the colour-blind can distinguish, and names as Matplotlib shows them.
plots         What `.plot()` of each type draws, of plain arrays.
panels        Axes to draw in, given or new, and pictures over the pixels of a view.
pictures      Pictures of sections, masks and depth maps as 8-bit sRGB, and as PNG files.
score_panels  Panels of a score: IoU of masks by plane and method, shares of depths, reliability of
              confidence.
"""

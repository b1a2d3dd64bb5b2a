"""Image processing: blocks, bright regions, outlines, watersheds."""

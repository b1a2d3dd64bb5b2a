"""What is really there: first hits, object edges within pixels, visible cameras, and their file.

first_hits      Truth: what each pixel's centre hits first.
pixel_coverage  Where between pixels objects end: the share of each pixel that its centre's object covers.
truth_file      The truth of a dataset on disk: every pass at the virtual centre, and of every view on
                request.
visibility      How many cameras see each point that the virtual centre sees.
"""

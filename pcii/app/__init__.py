"""The `pcii` command: order of the analysis, folder of results, report."""

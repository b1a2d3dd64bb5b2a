"""Where cameras stand and which way their pixels look; disparities."""

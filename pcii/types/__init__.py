"""Types of data, and what they rest on: Bayer patterns, camera geometry, focal planes."""

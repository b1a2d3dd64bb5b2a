"""What is on disk: datasets, collections and results, written whole, listed with hashes, and verified."""

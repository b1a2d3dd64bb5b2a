"""What comes in and goes out: images made by others are read, datasets are written for other tools."""

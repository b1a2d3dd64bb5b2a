"""What a scene or recipe will give, found without rendering it."""

"""What people write, validated: recipes and scenes with their grids, lights, materials, shapes."""

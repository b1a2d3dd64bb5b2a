"""From a recipe to a dataset on disk: resources, order of work, resuming, many seeds."""

"""The `simgen` command, and what it does as functions."""

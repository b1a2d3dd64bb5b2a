"""The `simgen` command.

commands  The `simgen` command.
"""

"""The `simgen` command.

commands  The `simgen` command.
library   What the commands do, as functions: scenes and recipes by name, photons without a file,
          datasets.
"""

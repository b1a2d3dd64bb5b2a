"""What everything rests on: keyed random streams, strict models of TOML files, sRGB, names of files.

asset_names     Names of files that a scene brings along, and where these files are: only inside its
                folder.
locations       Where scenes and recipes are found: the working directory, the source tree, the installed
                package.
random_streams  Random streams, keyed by stage of the work: the same for any number of workers and any
                order.
strict_models   What scene and recipe files share: strict models, TOML, and errors that point at the
                field.
toml_layout     Strict models as TOML that a person can read and edit.
"""

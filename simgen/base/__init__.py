"""What everything rests on: keyed random streams, strict models of TOML files, sRGB, names of files.

asset_names     Names of files that a scene brings along, and where these files are: only inside its
                folder.
locations       Where scenes and recipes are found: the working directory, the source tree, the installed
                package.
machine_cache   What takes long to find out and does not change on a machine, kept between processes.
neighbourhoods  Extreme values around each place of a map.
overrides       Values given as `key=value`, as `--set` has them.
random_streams  Random streams, keyed by stage of the work: the same for any number of workers and any
                order.
round_numbers   Numbers of two digits for messages, and by how much they may be off.
srgb            sRGB primaries (IEC 61966-2-1) from CIE XYZ.
strict_models   What scene and recipe files share: strict models, TOML, and errors that point at the
                field.
toml_layout     Strict models as TOML that a person can read and edit.
"""

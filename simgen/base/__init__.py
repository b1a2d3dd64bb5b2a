"""What everything rests on: keyed random streams, strict models of TOML files, where files are.

file_lookup     Where files are: scenes and recipes by name, what a scene brings along in its folder, and
                values that are cached between processes.
random_streams  Random streams, keyed by stage of the work: the same for any number of workers and any
                order.
strict_models   What scene and recipe files share: strict models, how they are read and written as TOML, and
                faults that name the field.
"""

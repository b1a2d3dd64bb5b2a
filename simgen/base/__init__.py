"""What everything rests on: keyed random streams, strict models of TOML files, where files are."""

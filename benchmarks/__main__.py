"""Print the tables; `make bench` calls this, with names of tables for some of them.

Without names all but "removal", "depth" and "depth-constants", which take days (corpus.py says how to make
them smaller).
"""

import sys

from benchmarks import accuracy, collections, colour, depth, depth_constants, photons, removal, sections

TABLES = {
    "sections": sections.table,
    "accuracy": accuracy.table,
    "photons": photons.table,
    "colour": colour.table,
    "collections": collections.table,
    "removal": removal.table,
    "depth": depth.table,
    "depth-constants": depth_constants.table,
}
LONG = ("removal", "depth", "depth-constants")
for name in sys.argv[1:] or (name for name in TABLES if name not in LONG):
    for line in TABLES[name]():
        print(line, flush=True)
    print()

"""Print every table; `make bench` calls this, with names of tables for some of them."""

import sys

from benchmarks import accuracy, colour, photons, sections

TABLES = {
    "sections": sections.table,
    "accuracy": accuracy.table,
    "photons": photons.table,
    "colour": colour.table,
}
for name in sys.argv[1:] or TABLES:
    for line in TABLES[name]():
        print(line, flush=True)
    print()

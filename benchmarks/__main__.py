"""Print every table; `make bench` calls this."""

from benchmarks import photons

for line in photons.table():
    print(line, flush=True)

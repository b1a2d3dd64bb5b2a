"""Run time against error, side by side in one run; `make bench` prints the tables."""

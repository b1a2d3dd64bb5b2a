"""Many datasets: rows, intervals, paired tests, tables and pages; and the public benchmark."""

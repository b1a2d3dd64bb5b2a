"""Many datasets: rows, intervals, paired tests, tables, plots and pages.

comparison        Methods compared: every dataset, photon budget and method once, scored against the truth
                  and timed.
evaluation_pages  An evaluation to keep and to read: evaluation.json, a self-contained page, and Markdown.
pages             Pages made from templates: all that is put in is text, and no page runs or fetches
                  anything.
paired_tests      Means over seeds with their uncertainty, and whether two methods differ on the same
                  datasets.
plots             Plots of an evaluation: accuracy against light, and against time.
rows              Scores as they are measured, one JSON object a line in rows.jsonl, through kills and by
                  many processes.
summary           Rows of an evaluation, summed up: means over seeds, and what is better than what.
tables            The tables of an evaluation as text, the same for HTML and Markdown.
timing            Wall time of a method alone: no call counts in which code was compiled or loaded.
"""

"""Many datasets: rows, intervals, paired tests, tables, plots and pages.

comparison        Methods compared over many datasets: each dataset, budget and method is scored and timed
                  once.
entropy_intervals Intervals of Table 1 for one dataset: how far the entropies would differ with other
                  photons.
evaluation_pages  Files of an evaluation: evaluation.json, a self-contained HTML page, and Markdown.
method_names      Methods of an evaluation by name: removal by its own, estimators of depth as depth:NAME.
pages             HTML pages made from templates: content is escaped as text, and pages fetch nothing.
paired_tests      Means over seeds with confidence intervals, and paired tests of two methods on the same
                  datasets.
plots             Plots of an evaluation: accuracy against photons per view and run time, and reliability
                  of confidence.
pooling           Methods pooled over scenes and ranked, on the datasets that all of them were scored on.
provenance        What made a figure: the source and the weights of what computes, versions, and the
                  machine.
rows              rows.jsonl: one JSON object per measured score, written safely by several processes at
                  once.
summary           Summary of the rows of an evaluation: means over seeds, and paired comparisons of
                  methods.
tables            Tables of an evaluation as text, the same for HTML and Markdown.
tasks             What an evaluation measures: every dataset at every light by every method, checked
                  before any work.
timing            Wall time of a method without the time of compiling or importing code.
"""

"""Many datasets: rows, intervals, paired tests, tables and pages; and the public benchmark.

benchmark_collection  The datasets of a benchmark, which `simgen benchmark make` makes, by half.
benchmark_jobs        The work of scoring a method on a benchmark: rows, pictures, bounds.
benchmark_page        One page of all submissions in a folder: ranks, lines over light, best and worst
                      scenes, and commands.
comparison            Methods compared over many datasets: each dataset, budget and method is scored and
                      timed once.
evaluation_pages      Files of an evaluation: evaluation.json, a self-contained HTML page, and Markdown.
method_names          Methods of an evaluation by name: removal by its own, estimators of depth as
                      depth:NAME.
pages                 HTML pages made from templates: content is escaped as text, and pages fetch nothing.
paired_tests          Means over seeds with confidence intervals, and paired tests of two methods on the
                      same datasets.
pooling               Methods pooled over scenes and ranked, on the datasets that all of them were scored
                      on.
provenance            What made a figure: the source and the weights of what computes, versions, and the
                      machine.
rows                  rows.jsonl: one JSON object per measured score, written safely by several processes
                      at once.
submission_checks     What is in a folder of results that were made elsewhere, and its faults.
submission_pictures   Small pictures of results beside the truth, by which one sees what the scores mean.
submission_scores     Scores of a method, run here, or of maps that were made elsewhere.
submitted_maps        Maps of depth and masks of a submission: where they are, checked as they are read.
summary               Summary of the rows of an evaluation: means over seeds, and paired comparisons of
                      methods.
tables                Tables of an evaluation as text, the same for HTML and Markdown.
tasks                 What an evaluation measures: every dataset at every light by every method, checked
                      before any work.
timing                Wall time of a method without the time of compiling or importing code.
"""

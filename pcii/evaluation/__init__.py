"""Many datasets: rows, intervals, paired tests, tables and pages; and the public benchmark.

benchmark_page     One page of all submissions in a folder: lines over light, tables, ranks, and commands.
benchmark_scores   Scores of a method on the public benchmark: of one that is run here, or of maps that were
                   made elsewhere.
comparison         Methods compared over many datasets: `pcii.evaluate`.
curves             A measure against photons and time, and how far confidence is right.
entropy_intervals  Intervals of Table 1 for one dataset: how far the entropies would differ with other
                   photons.
measurement        Measuring the tasks of an evaluation: a method is run, timed and scored against the truth.
method_names       Methods of an evaluation by name, removal by its own, depth as depth:NAME; their software.
pages              Pages: HTML made from templates, whose content is escaped as text, and the files of an
                   evaluation.
rows               Rows of an evaluation: rows.jsonl, which grows while methods are measured, and the frame
                   that they make.
submissions        Results of the benchmark that were made elsewhere: a folder of maps of depth and masks,
                   checked as read.
summary            Means of an evaluation with their intervals, and comparisons of methods on the same
                   datasets.
tables             Tables of an evaluation as text, the same for HTML and Markdown.
tasks              What an evaluation measures: every dataset at every light by every method, checked before
                   any work.
training_examples  Examples to train on: parts of films in random poses, with light drawn anew.
"""

"""The `pcii` command: order of the analysis, folder of results, report.

benchmark_commands  The command `pcii benchmark`.
command_options  Options that several commands take: folders, depths, a light, methods.
commands         The `pcii` command.
import_commands  The command `pcii import`: images made by others become a dataset.
pipeline         Analysis of a dataset, from sections to scores.
report           report.html: pictures, scores, and how they were made.
report_pictures  Pictures of a report: a view, sections through the depths, masks and truth, depth and error.
report_tables    Numbers of a report as text: entropies, scores of the masks and of the depth map.
results          The folder of results that commands write and later commands read.
step_commands    Commands that analyse one dataset: all steps, sections, depth, removal, score.
"""

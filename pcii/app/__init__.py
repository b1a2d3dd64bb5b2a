"""The `pcii` command: order of the analysis, folder of results, report.

benchmark_commands  The command `pcii benchmark`.
command_options  Options that several commands take: folders, depths, a light, methods.
commands         The `pcii` command.
import_commands  The command `pcii import`: images made by others become a dataset.
pipeline         Analysis of a dataset, from sections to scores, in the order of the paper's sections 2
                 and 3.
report           report.html: a slider through the depths, and the paper's figures and table for one
                 dataset with its truth.
report_figures   Pictures of a report: the panels of the paper's Figures 6 and 7, and the depth map with its
                 error.
report_origin    How a report was made: commands, dates, machine, recipe, versions, hashes, and what was
                 skipped.
report_slider    Sections through the whole depth range, for the slider of a report, and what is read out at a
                 pixel.
report_tables    Numbers of a report as text: key facts, Table 1, scores of the masks and of the depth map.
results          The folder of results that commands write and later commands read.
step_commands    Commands that analyse one dataset: all steps, sections, depth, removal, score.
"""

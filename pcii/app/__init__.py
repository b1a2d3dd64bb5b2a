"""The `pcii` command: order of the analysis, folder of results, report.

command_options  Options that several commands take: folder of results, depths, a smaller photon budget.
commands         The `pcii` command.
import_commands  The command `pcii import`: images made by others become a dataset.
import_source    What `pcii import` was told to read, read, and how to mend it if the views do not fit
                 together.
long_steps       The long steps of an analysis; what an earlier run did is kept if nothing that it follows
                 from has changed.
pipeline         Analysis of a dataset, from sections to scores, in the order of the paper's sections 2
                 and 3.
report           report.html: the paper's Figures 6 and 7 and Table 1 for one dataset, with the truth
                 beside them.
results          The folder of results that commands write and later commands read.
single_run       Analysis of one dataset with all its results written: sections, masks, depth, scores and
                 report.
step_commands    Commands for single steps of the analysis: sections, depth, removal.
"""

"""The `pcii` command: the method in order, its folder of results, its report.

commands    The `pcii` command.
pipeline    The method from dataset to score, in the order of the paper's sections 2 and 3.
report      report.html: the paper's Figures 6 and 7 and Table 1 from this dataset, the truth beside them.
results     The folder of results: what the commands leave behind, so that a later command can go on from
            it.
single_run  One dataset, everything: analyse it and leave sections, masks, depth, scores and the report.
"""

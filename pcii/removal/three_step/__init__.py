"""The paper's removal in three steps: threshold, boundary, entropy (Eqs. 7-9).

edge_entropy       Step 3 of the removal: the entropy (Muniraj et al. 2017, Eq. 9) of the edges of each
                   region.
three_step_method  Removal of defocused points in the paper's three steps (Muniraj et al. 2017, section
                   3).
"""

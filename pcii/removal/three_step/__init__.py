"""The paper's removal in three steps: threshold, boundary, entropy (Eqs. 7-9).

edge_entropy        Step 3 of the three-step removal: the entropy of the edges of each region (Muniraj et
                    al. 2017, Eq. 9).
three_step_method   Removal of defocused points by the three steps of Muniraj et al. 2017, section 3.
variance_threshold  Adaptive threshold on the variance of the non-zero samples: Muniraj et al. 2017, Eq.
                    7.
"""

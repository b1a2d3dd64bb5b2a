"""What photons say about depth: how well a section predicts where they land, and whether cameras agree.

cells               The coarse grid on which evidence of focus is kept.
focus_kernels       Compiled loops over photons and planes: what a plane predicts of photons, and which of
                    several does best.
focus_likelihood    Evidence of focus from the Poisson likelihood: what does the section at a depth
                    predict?
half_agreement      Do both halves of the cameras show the same thing?
hot_pixels          Pixels that are hot in the same place of all cameras: what is fixed to the sensor
                    tells no depth.
label_kernels       Compiled loops over cells: evidence summed within edges, and labels that agree with
                    their neighbours.
prediction_kernels  Compiled: the rate of each photon's own pixel and colour, as all other photons of a
                    section tell it.
prediction_types    What the compiled loops that predict photons take and give, without the compiler.
projection_kernels  Compiled: the cells of a section that events fall into, and how many views cover each
                    block of pixels.
smoothing_kernels   Compiled: light at coarser and coarser scales, and between the centres of cells.
"""

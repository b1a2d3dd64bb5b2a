"""Evidence of depth in photon counts: how well a section predicts the photons, and whether cameras agree.

cells               The coarse grid on which evidence of focus is kept.
focus_kernels       Compiled loops over photons and planes: the gain of a plane over its blur, and planes
                    compared.
focus_likelihood    Evidence of focus from the Poisson likelihood: how well does the section at a depth
                    predict the photons?
half_agreement      Whether both halves of the cameras show the same structure, and in focus: one camera
                    shows no depth.
hot_pixels          Hot pixels at the same place of all cameras, which belong to the sensor and not to the
                    scene.
label_kernels       Compiled loops over cells: evidence summed between edges, and labels by belief
                    propagation.
octave_kernels      Compiled: means of the blocks of a section, and the evidence of octaves, from fine to
                    coarse and back.
prediction_kernels  Compiled: the rate of each photon's pixel and colour, estimated from all other photons
                    of a section.
prediction_types    Arguments and results of the compiled loops that predict photons; importing them needs
                    no compiler.
projection_kernels  Compiled: the cells of a section that events fall into, and how many views cover each
                    block of pixels.
smoothing_kernels   Compiled: sums of photons at coarser and coarser scales, interpolated between the
                    centres of cells.
texture_evidence    Evidence of depth from texture: at which plane does a section show more contrast than
                    its noise explains?
weighted_sums       Sums over cameras in the blocks of a section, with a weight for each camera.
"""

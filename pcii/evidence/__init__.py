"""Evidence of depth in photon counts: at which plane texture is sharp, and whether cameras agree.

cells               The coarse grid in which halves of the cameras are compared.
half_agreement      Whether both halves of the cameras show the same structure, and in focus: one camera
                    shows no depth.
hot_pixels          Hot pixels at the same place of all cameras, which belong to the sensor and not to the
                    scene.
octave_kernels      Compiled: means of the blocks of a section, and the evidence of octaves, from fine to
                    coarse and back.
projection_kernels  Compiled: the cells of a section that events fall into.
texture_evidence    Evidence of depth from texture: at which plane does a section show more contrast than
                    its noise explains?
weighted_sums       Sums over cameras in the blocks of a section, with a weight for each camera.
"""

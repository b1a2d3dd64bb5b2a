"""Evidence of depth in photon counts: at which plane texture is sharp, and whether a depth is shown at all.

camera_fit          Do views fit the stated cameras? Where they are sharp, and which order or shift does.
hot_pixels          Hot pixels at the same place of all cameras, which belong to the sensor and not to the
                    scene.
octave_kernels      Compiled: means of the blocks of a section, and the evidence of octaves, from fine to
                    coarse and back.
shown_depth         Where there is a depth to be seen at all: evidence that is lost behind infinity.
texture_evidence    Evidence of depth from texture: at which plane does a section show more contrast than
                    its noise explains?
"""

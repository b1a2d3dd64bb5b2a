"""Evidence of depth in photon counts: at which plane texture is sharp, and whether depth is shown at all."""

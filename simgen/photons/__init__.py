"""Photon counts: by thinning a majorant, or from rendered views, and which of the two."""

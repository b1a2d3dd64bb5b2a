"""The paper's removal in three steps: threshold, boundary, entropy (Eqs. 7-9)."""

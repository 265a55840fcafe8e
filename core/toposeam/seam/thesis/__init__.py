"""The thesis's method: SIMP and MMA on the ground structure."""

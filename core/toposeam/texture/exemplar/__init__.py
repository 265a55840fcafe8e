"""Exemplars, the atlas they lie on, and the search for patches in it."""

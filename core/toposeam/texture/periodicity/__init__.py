"""The lattice on which a texture repeats, and positions in phase with it."""

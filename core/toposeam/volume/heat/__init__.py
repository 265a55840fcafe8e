"""The heat method for surfaces, coarse to fine and block by block."""

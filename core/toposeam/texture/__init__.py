"""Textures laid from patches of samples, joined along the best seams: synthesis, tiles, filled holes."""

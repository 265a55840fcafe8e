"""Textures laid from patches of samples, joined along heat seams: synthesis, tiles, filled holes."""

"""Minimise the cost of a labelling: expansion moves, coarse to fine."""

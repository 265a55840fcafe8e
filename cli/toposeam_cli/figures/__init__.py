"""Drawings for people: how heat found a seam, and products with a pattern on them."""

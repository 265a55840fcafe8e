"""Recipes of motifs, simplified and varied."""

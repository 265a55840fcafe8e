"""Placed layers joined into one picture."""

"""Clips that loop: periods, walks, light."""

"""Seams as lines: traced from labels, written to and read from SVG, and applied to the patches again."""

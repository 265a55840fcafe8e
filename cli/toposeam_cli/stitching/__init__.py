"""Stitching of files: inputs, positions, options of the search, outputs."""

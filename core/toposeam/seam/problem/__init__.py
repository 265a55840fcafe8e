"""The seam problem: overlap, match cost and the grid of interfaces."""

"""The page on which motifs grow: what is drawn on a cell, the process that solves, and what both say."""

"""From layers to a composite and its seams."""

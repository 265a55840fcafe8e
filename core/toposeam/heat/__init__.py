"""Networks of heat conductors and their solution. Knows nothing of images."""

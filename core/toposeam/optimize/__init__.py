"""Optimisers and the records they keep. Knows nothing of images."""

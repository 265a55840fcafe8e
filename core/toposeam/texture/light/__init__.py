"""Slow light of exemplars: removed, levelled, eased at seams."""

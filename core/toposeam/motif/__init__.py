"""Motifs: images that heat invents, and the patterns they repeat to. See docs/motifs.md."""

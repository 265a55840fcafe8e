"""Solids: what heat builds in a block, as a mesh. See docs/patterns.md."""

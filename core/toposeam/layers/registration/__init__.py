"""Find where pictures belong: features, pairs, a pose graph."""

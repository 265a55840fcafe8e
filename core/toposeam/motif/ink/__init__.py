"""From densities to prints: edges of strokes, inks, colours, vectors."""

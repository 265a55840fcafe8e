"""Motifs invented by heat on a plate: their layers, colours, repeats, and what is drawn from them."""

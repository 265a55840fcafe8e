"""The labelling problem: which layers are allowed at a pixel, and what an interface costs."""

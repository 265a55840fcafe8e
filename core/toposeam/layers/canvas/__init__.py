"""Layers on a canvas, label maps and masks that may be larger than memory."""

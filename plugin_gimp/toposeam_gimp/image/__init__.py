"""Layers, pixels and paths of GIMP's images."""

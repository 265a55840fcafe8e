"""Blend across seams: feather, multiband, gradient domain."""

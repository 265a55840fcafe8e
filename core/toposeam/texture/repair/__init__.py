"""Repair a finished texture: bad seams and cut objects."""

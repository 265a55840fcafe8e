"""Seams between two overlapping patches."""

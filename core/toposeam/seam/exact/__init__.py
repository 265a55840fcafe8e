"""Exact engines: shortest paths between corners and maximum flows."""

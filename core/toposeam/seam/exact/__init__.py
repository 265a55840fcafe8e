"""Exact engines: shortest paths between corners, maximum flows, and expansion moves."""

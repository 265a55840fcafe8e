"""The surface problem of two volumes."""

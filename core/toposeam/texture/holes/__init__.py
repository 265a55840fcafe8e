"""Fill holes of photographs by shift-maps."""

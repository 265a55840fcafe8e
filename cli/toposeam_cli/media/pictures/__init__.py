"""Pictures, and the files they live in: formats, colour, layers, layouts, recipes. No click in here."""

"""Files that say where pictures lie."""

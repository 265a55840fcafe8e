"""The table of menu entries, their fields and the manual. GI-free."""

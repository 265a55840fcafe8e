"""GIMP's folders, what is installed there, and why it is not in the menu."""

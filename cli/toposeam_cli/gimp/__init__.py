"""GIMP's folders and programs, the installation of the plug-in, and the diagnosis where it is not in the
menu.
"""

"""Filters → TopoSeam for GIMP 3.

The folder is the plug-in: GIMP runs ``toposeam_gimp.py``. It uses the standard library and ``gi`` only; the
numerics are in the engine, a child process of an installed TopoSeam (:mod:`toposeam_gimp.engine.process`).
Modules whose first line says *GI-free* can be used and tested anywhere.
"""

#: The version; that of the engine's TopoSeam must be equal.
__version__ = "0.2.0"

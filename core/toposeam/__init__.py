"""TopoSeam: join, grow and invent images by heat.

Arrays in, arrays and dataclasses out; files belong to the command line (``toposeam``) and the GIMP plug-in.
What the package offers is listed in ``__init__.pyi``; each name is loaded when it is first used, so that
importing the package costs next to nothing.
"""

import lazy_loader

__version__ = "0.2.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Make objects on a ground whole in a finished texture, and exchange those that repeat near by.

:func:`make_objects_whole` is the only door of this room.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

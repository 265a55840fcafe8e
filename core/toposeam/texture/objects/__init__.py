"""Whole objects on a ground: few ones are laid last, and many are made whole in a finished texture.

:func:`find_scattered` with :func:`lay_scattered`, and :func:`make_objects_whole`, are the doors of this room.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

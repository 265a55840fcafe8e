"""The boundary of a joined picture: bent a little towards a rectangle, filled, and cropped."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

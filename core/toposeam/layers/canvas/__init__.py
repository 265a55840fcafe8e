"""Layers on a canvas, label maps and masks that may be larger than memory."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The labelling problem: which layers are allowed at a pixel, and what an interface costs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

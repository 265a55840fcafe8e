"""Exemplars, the atlas they lie on, and the search for patches in it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

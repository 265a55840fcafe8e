"""The lattice on which a texture repeats, and positions in phase with it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

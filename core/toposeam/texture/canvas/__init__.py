"""The index canvas: which pixel of the atlas shows where, rendered to a texture."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

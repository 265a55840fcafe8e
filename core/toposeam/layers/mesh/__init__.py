"""Trial seams at reduced size, and meshes that bend pictures until these are cheap."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

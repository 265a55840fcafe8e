"""Run independent tasks here, in processes or on a cluster, and report progress."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

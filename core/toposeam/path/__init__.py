"""Ways for a robot, planned by heat conduction on a plate."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

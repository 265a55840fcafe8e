"""Ways for a robot, planned by heat conduction on a plate."""

import lazy_loader

from toposeam import verbs

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

verbs.called(__name__, "plan", "path")

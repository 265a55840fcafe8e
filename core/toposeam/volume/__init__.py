"""Volumes and clips: surfaces between overlapping ones, joined stacks, loops of clips."""

import lazy_loader

from toposeam import verbs

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

verbs.called(__name__, "join", "volume")

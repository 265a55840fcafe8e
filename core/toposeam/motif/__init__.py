"""Motifs: images that heat invents, and the patterns they repeat to. See docs/motifs.md."""

import lazy_loader

from toposeam import verbs

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

verbs.called(__name__, "generate", "motif")

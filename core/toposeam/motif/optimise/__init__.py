"""Optimise layers of a motif: heat conduction, optimality criteria, compounds."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

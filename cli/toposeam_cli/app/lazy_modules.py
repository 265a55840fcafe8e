"""Rarely used modules that others import, loaded at their first use.

SciPy names all that NumPy has (``scipy._lib.array_api_compat``), and so loads what NumPy loads late: its
Fortran wrappers, its tests with :mod:`unittest`, masked arrays. That is an eighth of what a command's modules
take.
"""

from __future__ import annotations

import sys
from importlib.util import LazyLoader, find_spec, module_from_spec

#: Submodules of NumPy that we never use.
UNUSED = ("numpy.ctypeslib", "numpy.f2py", "numpy.ma", "numpy.polynomial", "numpy.testing")


def loaded_later(names: tuple[str, ...] = UNUSED) -> None:
    """Let submodules be loaded when something in them is looked at, not when they are imported.

    Parameters
    ----------
    names : tuple of str
        With the names of their packages, which are loaded. What is loaded already, or is not there, stays so.
    """
    for name in names:
        spec = None if name in sys.modules else find_spec(name)
        if spec is None or spec.loader is None:
            continue
        spec.loader = LazyLoader(spec.loader)
        module = sys.modules[name] = module_from_spec(spec)
        spec.loader.exec_module(module)
        package, _, own = name.rpartition(".")
        setattr(sys.modules[package], own, module)

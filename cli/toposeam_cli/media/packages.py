"""Optional packages: how to install what is missing.

TopoSeam is on no package index, so that no name of an extra is an answer: a stranger may take the name there.
"""

from __future__ import annotations

#: The packages that bring each one, where these are others.
_BROUGHT = {
    "dask": "'dask[array]'",
    "distributed": "distributed cryptography",
    "pyvips": "'pyvips[binary]'",
}


def how_to_install(package: str) -> str:
    """Return the end of a sentence that says how to get a package.

    Examples
    --------
    >>> how_to_install("av"), how_to_install("dask")
    ('install it with: pip install av', "install it with: pip install 'dask[array]'")
    """
    return f"install it with: pip install {_BROUGHT.get(package, package)}"

"""The errors a caller can meet. Each derives from :class:`TopoSeamError` and from the builtin it
specialises.
"""


class TopoSeamError(Exception):
    """Root of every error this package raises on purpose; its text says what was received and what to do."""


class ImageError(TopoSeamError, ValueError):
    """An image array (or file) that cannot be used: shape, channels, dtype, NaN."""


class OverlapError(TopoSeamError, ValueError):
    """The patches do not overlap in a way that admits a seam."""


class OptionError(TopoSeamError, ValueError):
    """An option outside its range, or options that contradict each other."""


class PathError(TopoSeamError, ValueError):
    """A vector path that cannot be read, or that does not cut the overlap."""


class MissingPackageError(TopoSeamError, ImportError):
    """An optional package that was asked for is not installed."""


class SolverError(TopoSeamError, RuntimeError):
    """The numerical solution broke down."""

"""The errors a caller can meet. Each derives from :class:`TopoSeamError` and from the builtin it specialises."""

import math


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


def check_range(low: float, high: float = math.inf, *, above: bool = False, **options: float) -> None:
    """Refuse options outside [low, high], or outside (low, high] where they must be `above`; infinite ones and NaN always.

    Raises
    ------
    OptionError
        Names the first option that is out of range.
    """
    for name, value in options.items():
        if (low < value if above else low <= value) and value <= high and value < math.inf:
            continue
        if high == math.inf:
            wanted = "positive" if above and low == 0 else f"{'above' if above else 'at least'} {low:g}"
        else:
            wanted = f"above {low:g} and at most {high:g}" if above else f"between {low:g} and {high:g}"
        raise OptionError(f"{name} is {value}; it must be {wanted}")

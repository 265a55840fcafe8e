"""Types of arrays, for annotations; the docstring of what takes or returns one gives its shape and range."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

#: (H, W) or (H, W, C) pixels of any integer or float dtype.
Image = npt.NDArray[Any]
Mask = npt.NDArray[np.bool_]

Floats = npt.NDArray[np.float64]
Floats32 = npt.NDArray[np.float32]
Complexes = npt.NDArray[np.complex128]
Complexes32 = npt.NDArray[np.complex64]

Bytes = npt.NDArray[np.uint8]
#: Numbers of pixels, nodes or elements, to index with.
Indices = npt.NDArray[np.intp]
Ints = npt.NDArray[np.int64]
Ints32 = npt.NDArray[np.int32]

#: (H, W) number of the layer that shows at each pixel of a canvas, -1 where none does.
Labels = npt.NDArray[np.int16]

#: Floats and signed integers of any precision.
AnyFloats = npt.NDArray[np.floating[Any]]
AnyInts = npt.NDArray[np.signedinteger[Any]]
#: (D, H, W) or (D, H, W, C) voxels of any integer or float dtype.
Volume = npt.NDArray[Any]

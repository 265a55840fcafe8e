import typing as _typing

import toposeam.verbs as _verbs

from . import layers, optimize, seam, solid, texture, typing, vector
from .display import to_pil
from .errors import (
    ImageError,
    MissingPackageError,
    OptionError,
    OverlapError,
    PathError,
    SolverError,
    TopoSeamError,
)
from .images import MAX_PIXELS, Windows
from .layers.canvas.layer import Layer
from .layers.composite.judge import verdict
from .layers.composite.stitching import stitch
from .layers.registration.find_places import find_places
from .motif.generate import generate_motif
from .motif.motif import repeat
from .path.plan import plan_path
from .seam.find import find_seam
from .texture.fill import fill
from .texture.synthesize import synth, synthesize
from .texture.tile import make_tileable, tile
from .volume.clip.loop import loop
from .volume.find import find_surface
from .volume.join import join_volumes

if not _typing.TYPE_CHECKING:  # rooms that are called: type checkers know no module that is
    from . import motif, path, volume

motif: _verbs.MotifVerb
path: _verbs.PathVerb
volume: _verbs.VolumeVerb

__version__: str

__all__ = [
    "MAX_PIXELS",
    "ImageError",
    "Layer",
    "MissingPackageError",
    "OptionError",
    "OverlapError",
    "PathError",
    "SolverError",
    "TopoSeamError",
    "Windows",
    "fill",
    "find_places",
    "find_seam",
    "find_surface",
    "generate_motif",
    "join_volumes",
    "layers",
    "loop",
    "make_tileable",
    "motif",
    "optimize",
    "path",
    "plan_path",
    "repeat",
    "seam",
    "solid",
    "stitch",
    "synth",
    "synthesize",
    "texture",
    "tile",
    "to_pil",
    "typing",
    "vector",
    "verdict",
    "volume",
]

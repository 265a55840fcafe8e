"""TopoSeam: join, grow and invent images along optimal seams.

The verbs; commands of ``toposeam`` with the same names do the same to files:

- Join: `stitch` pictures, make a clip `loop`, join stacks of slices with `volume`; `find_places`, `find_seam`
  and `find_surface` say where pictures lie and are cut; `verdict` judges any joined picture.
- Grow: `synth` a texture from a sample, `tile` a picture so that it repeats, `fill` what a mask covers.
- Invent: a `motif`, and `repeat` it.
- Plan: a `path` over a map of costs.

Arrays and PIL pictures go in; results are pictures themselves (``np.asarray(result)``, ``to_pil(result)``)
with masks, seams and settings. More is in the rooms `layers`, `seam`, `texture`, `motif`, `volume`, `path`,
`solid`, `vector`, `optimize` and `typing`; three of them are verbs as well. In annotations, import a class
from its room: ``from toposeam.motif import Recipe``. Former names stay for a version: `make_tileable`,
`synthesize`, `generate_motif`, `join_volumes` and `plan_path`.
"""

import lazy_loader

__version__ = "0.2.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""TopoSeam: join, grow and invent images along optimal seams.

The verbs, with the commands of ``toposeam`` that do the same to files:

- Join: `stitch` pictures (``stitch``), make a clip `loop` (``loop``), join stacks of slices by `join_volumes`
  (``volume``); `find_places`, `find_seam` and `find_surface` say where pictures lie and are cut.
- Grow: `synth` a texture from a sample (``synth``), `tile` a picture so that it repeats (``tile``), `fill`
  what a mask covers (``fill``).
- Invent: `generate_motif` (``motif``) and `repeat` it (``repeat``).
- Plan: `plan_path` over a map of costs (``path``).

Arrays and PIL pictures go in; results are pictures themselves (``np.asarray(result)``, ``to_pil(result)``)
with masks, seams and settings. More is in the rooms `layers`, `seam`, `texture`, `motif`, `volume`, `path`,
`solid`, `vector`, `optimize` and `typing`. `make_tileable` and `synthesize` are former names of `tile` and
`synth`.
"""

import lazy_loader

__version__ = "0.2.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

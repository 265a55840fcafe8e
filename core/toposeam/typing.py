"""Types of arguments, for annotations: ``def join(method: ts.typing.Method)``."""

from toposeam.layers.blending.blend import Blend
from toposeam.seam.find import Method
from toposeam.seam.problem.match_cost import Law
from toposeam.seam.problem.overlap import Side
from toposeam.texture.exemplar.turns import Turns
from toposeam.texture.fill import By
from toposeam.texture.setting_trial import Setting
from toposeam.volume.find import SurfaceMethod

__all__ = ["Blend", "By", "Law", "Method", "Setting", "Side", "SurfaceMethod", "Turns"]

from .find import METHODS
from .heat.method import HeatOptions
from .problem.match_cost import LAWS, MatchCost
from .problem.overlap import SIDES
from .result.drawing import draw_seams
from .result.likeness import seam_verdict
from .result.seam import Seam, apply_paths
from .result.verdict import Verdict
from .thesis.options import ThesisOptions

__all__ = [
    "LAWS",
    "METHODS",
    "SIDES",
    "HeatOptions",
    "MatchCost",
    "Seam",
    "ThesisOptions",
    "Verdict",
    "apply_paths",
    "draw_seams",
    "seam_verdict",
]

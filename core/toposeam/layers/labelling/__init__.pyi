from .pair_cost import KEPT_PIXELS, LayerPairCost
from .posing import CORE, check_pairs, exclusive_covers, meets, pose_labelling
from .problem import Labelling, Pair, PairCost
from .seam_lines import beside_steps, doubled_around, junctions, reached, square_dilation
from .subproblem import part_of_labelling
from .table_costs import TableCost, spread

__all__ = [
    "CORE",
    "KEPT_PIXELS",
    "Labelling",
    "LayerPairCost",
    "Pair",
    "PairCost",
    "TableCost",
    "beside_steps",
    "check_pairs",
    "doubled_around",
    "exclusive_covers",
    "junctions",
    "meets",
    "part_of_labelling",
    "pose_labelling",
    "reached",
    "spread",
    "square_dilation",
]

from .label_map import LabelMap, Pair, as_labels
from .pair_cost import KEPT_PIXELS, LayerPairCost
from .posing import CORE, check_pairs, meets, pose_labelling
from .problem import Labelling, PairCost
from .seam_lines import beside_steps, doubled_around, junctions, reached, square_dilation
from .strokes import KINDS, Stroke, StrokeKind, apply_strokes
from .subproblem import part_of_labelling, window_of_labelling
from .table_costs import TableCost, spread

__all__ = [
    "CORE",
    "KEPT_PIXELS",
    "KINDS",
    "LabelMap",
    "Labelling",
    "LayerPairCost",
    "Pair",
    "PairCost",
    "Stroke",
    "StrokeKind",
    "TableCost",
    "apply_strokes",
    "as_labels",
    "beside_steps",
    "check_pairs",
    "doubled_around",
    "junctions",
    "meets",
    "part_of_labelling",
    "pose_labelling",
    "reached",
    "spread",
    "square_dilation",
    "window_of_labelling",
]

from .corner_graph import cheapest_path
from .expansion import LEAST_GAIN, BinaryCut, Decide, ExpansionMove, interfaces_beside
from .graph_cut import graph_cut_labels, least_cut
from .maximum_flow import minimum_cut
from .optimum import cut_by_flow, cut_cost, exact_labels, labels_of_nodes, pieces, shortest_path

__all__ = [
    "LEAST_GAIN",
    "BinaryCut",
    "Decide",
    "ExpansionMove",
    "cheapest_path",
    "cut_by_flow",
    "cut_cost",
    "exact_labels",
    "graph_cut_labels",
    "interfaces_beside",
    "labels_of_nodes",
    "least_cut",
    "minimum_cut",
    "pieces",
    "shortest_path",
]

"""The peer for labellings of many layers: α-expansion with PyMaxflow, written from Boykov, Veksler and Zabih
2001.
"""

from __future__ import annotations

import numpy as np

from toposeam.layers.canvas import cut
from toposeam.layers.labelling import Labelling


class Expansion:
    """The labelling problem of some layers as tables: cost of each pair of labels at each interface, and what
    is allowed where.
    """

    def __init__(self, labelling: Labelling) -> None:
        self.count = len(labelling.places)
        height, width = labelling.canvas.shape
        self.tables = [
            np.zeros((self.count, self.count, height, width - 1)),
            np.zeros((self.count, self.count, height - 1, width)),
        ]
        for i in range(self.count):
            for j in range(i + 1, self.count):
                cost = labelling.costs.get((i, j))
                if cost is not None:
                    for table, values in zip(self.tables, cost.on(labelling.canvas), strict=True):
                        table[i, j] = table[j, i] = values
        self.allowed = [
            cut(labelling.allowed[k], labelling.places[k], labelling.canvas) for k in range(self.count)
        ]

    def energy(self, label_map: np.ndarray) -> float:
        return sum(values.sum() for _, values in self._interfaces(label_map))

    def _interfaces(self, label_map):
        for table, s, t in zip(
            self.tables, (np.s_[:, :-1], np.s_[:-1]), (np.s_[:, 1:], np.s_[1:]), strict=True
        ):
            row, column = np.nonzero((label_map[s] >= 0) & (label_map[t] >= 0))
            yield (
                (table, s, t, row, column),
                table[label_map[s][row, column], label_map[t][row, column], row, column],
            )

    def expand(self, label_map: np.ndarray, label: int) -> np.ndarray:
        import maxflow

        free = (label_map >= 0) & self.allowed[label] & (label_map != label)
        number = np.full(label_map.shape, -1)
        number[free] = np.arange(free.sum())
        count = int(free.sum())
        if not count:
            return label_map
        graph = maxflow.GraphFloat(count, 4 * count)
        graph.add_nodes(count)
        keep, turn = np.zeros(count), np.zeros(count)
        for (table, s, t, row, column), kept in self._interfaces(label_map):
            p, q = number[s][row, column], number[t][row, column]
            q_turns = table[label_map[s][row, column], label, row, column]
            p_turns = table[label, label_map[t][row, column], row, column]
            both = (p >= 0) & (q >= 0)
            stay = np.minimum(kept, q_turns + p_turns)[
                both
            ]  # not a metric: truncated to what a graph can hold
            np.add.at(keep, p[both], stay)
            np.add.at(turn, p[both], p_turns[both])
            np.add.at(turn, q[both], -p_turns[both])
            for first, second, weight in zip(
                p[both], q[both], q_turns[both] + p_turns[both] - stay, strict=True
            ):
                graph.add_edge(int(first), int(second), float(weight), 0.0)
            for alone, turned, node in (((p >= 0) & (q < 0), p_turns, p), ((p < 0) & (q >= 0), q_turns, q)):
                np.add.at(keep, node[alone], kept[alone])
                np.add.at(turn, node[alone], turned[alone])
        least = np.minimum(keep, turn)
        for node in range(count):
            graph.add_tedge(node, turn[node] - least[node], keep[node] - least[node])
        graph.maxflow()
        turned = np.array([graph.get_segment(node) for node in range(count)], bool)
        result = label_map.copy()
        result[free] = np.where(turned, label, label_map[free])
        return result

    def minimise(self, label_map: np.ndarray) -> float:
        """Cycles over all labels until none gains."""
        best = self.energy(label_map)
        while True:
            before = best
            for label in range(self.count):
                new = self.expand(label_map, label)
                if self.energy(new) < best - 1e-9:
                    label_map, best = new, self.energy(new)
            if best == before:
                return best

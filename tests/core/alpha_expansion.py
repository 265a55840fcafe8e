"""The peer for labellings of many layers: α-expansion with PyMaxflow, written from Boykov, Veksler and Zabih 2001."""

from __future__ import annotations

import numpy as np

from toposeam.layers.labelling import Labelling
from toposeam.layers.layer import cut


class Expansion:
    """The labelling problem of some layers as tables: cost of each pair of labels at each interface, and what is allowed where."""

    def __init__(self, labelling: Labelling) -> None:
        self.count = len(labelling.layers)
        height, width = labelling.canvas.shape
        self.tables = [np.zeros((self.count, self.count, height, width - 1)), np.zeros((self.count, self.count, height - 1, width))]
        for i in range(self.count):
            for j in range(i + 1, self.count):
                cost = labelling.cost((i, j))
                if cost is not None:
                    for table, values in zip(self.tables, cost.on(labelling.canvas.box), strict=True):
                        table[i, j] = table[j, i] = values
        self.allowed = [cut(labelling.allowed[k], labelling.places[k], labelling.canvas.box) for k in range(self.count)]

    def energy(self, owner: np.ndarray) -> float:
        return sum(values.sum() for _, values in self._interfaces(owner))

    def _interfaces(self, owner):
        for table, s, t in zip(self.tables, (np.s_[:, :-1], np.s_[:-1]), (np.s_[:, 1:], np.s_[1:]), strict=True):
            row, column = np.nonzero((owner[s] >= 0) & (owner[t] >= 0))
            yield (table, s, t, row, column), table[owner[s][row, column], owner[t][row, column], row, column]

    def expand(self, owner: np.ndarray, label: int) -> np.ndarray:
        import maxflow

        free = (owner >= 0) & self.allowed[label] & (owner != label)
        number = np.full(owner.shape, -1)
        number[free] = np.arange(free.sum())
        count = int(free.sum())
        if not count:
            return owner
        graph = maxflow.GraphFloat(count, 4 * count)
        graph.add_nodes(count)
        keep, turn = np.zeros(count), np.zeros(count)
        for (table, s, t, row, column), kept in self._interfaces(owner):
            p, q = number[s][row, column], number[t][row, column]
            q_turns = table[owner[s][row, column], label, row, column]
            p_turns = table[label, owner[t][row, column], row, column]
            both = (p >= 0) & (q >= 0)
            stay = np.minimum(kept, q_turns + p_turns)[both]  # not a metric: truncated to what a graph can hold
            np.add.at(keep, p[both], stay)
            np.add.at(turn, p[both], p_turns[both])
            np.add.at(turn, q[both], -p_turns[both])
            for first, second, weight in zip(p[both], q[both], q_turns[both] + p_turns[both] - stay, strict=True):
                graph.add_edge(int(first), int(second), float(weight), 0.0)
            for alone, turned, node in (((p >= 0) & (q < 0), p_turns, p), ((p < 0) & (q >= 0), q_turns, q)):
                np.add.at(keep, node[alone], kept[alone])
                np.add.at(turn, node[alone], turned[alone])
        least = np.minimum(keep, turn)
        for node in range(count):
            graph.add_tedge(node, turn[node] - least[node], keep[node] - least[node])
        graph.maxflow()
        turned = np.array([graph.get_segment(node) for node in range(count)], bool)
        result = owner.copy()
        result[free] = np.where(turned, label, owner[free])
        return result

    def minimise(self, owner: np.ndarray) -> float:
        """Cycles over all labels until none gains."""
        best = self.energy(owner)
        while True:
            before = best
            for label in range(self.count):
                new = self.expand(owner, label)
                if self.energy(new) < best - 1e-9:
                    owner, best = new, self.energy(new)
            if best == before:
                return best

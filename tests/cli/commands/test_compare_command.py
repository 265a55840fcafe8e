"""``toposeam compare``."""

import json
import sys

import pytest

import toposeam as ts
from stitching import STRIP, names


def test_compare_tells_every_method(folder, toposeam):
    pytest.importorskip("maxflow")
    ran = toposeam("compare", *STRIP)
    assert (ran.code, ran.err) == (0, "")
    head, *rows = ran.out.splitlines()
    assert head.split() == ["method", "cost", "÷", "optimum", "seconds", "iterations", "likeness", "worst"]
    assert [row.split()[0] for row in rows] == [method for method in ts.seam.METHODS if method != "auto"]
    assert names(folder) == ["a.png", "b.png"]


def test_compare_as_json(folder, toposeam):
    ran = toposeam("compare", *STRIP, "--method", "dp", "--method", "heat", "--json")
    rows = json.loads(ran.out)
    assert [row["method"] for row in rows] == ["dp", "heat"]
    assert all(row["ratio"] >= 1 - 1e-6 and row["seconds"] > 0 for row in rows)
    joined = json.loads(toposeam("stitch", *STRIP, "-o", "out.png", "--json").out)
    assert rows[1]["cost"] == pytest.approx(joined["cost"], rel=1e-3)


def test_compare_says_which_method_cannot_and_why(folder, toposeam, monkeypatch):
    monkeypatch.setitem(sys.modules, "maxflow", None)
    ran = toposeam(
        "compare",
        "a.png",
        "b.png",
        "--offset",
        "30,9",
        "--method",
        "dp",
        "--method",
        "graph-cut",
        "--method",
        "shortest-path",
    )
    assert ran.code == 0
    _, dp, graph_cut, shortest = ran.out.splitlines()
    assert "rectangular" in dp
    assert "pip install PyMaxflow" in graph_cut
    assert "1.00000" in shortest
    rows = json.loads(
        toposeam("compare", "a.png", "b.png", "--offset", "30,9", "--method", "dp", "--json").out
    )
    assert set(rows[0]) == {"method", "note"}

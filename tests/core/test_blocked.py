"""All of the library runs without libvips, qdldl, click and threads, as in a browser: the examples of every
public name do.
"""

import inspect
import json
import os
import subprocess
import sys

import pytest
from public_names import public_names

BLOCKED = """
import sys
for name in ("pyvips", "cffi", "qdldl", "click", "toposeam_cli", "maxflow", "dask", "matplotlib"):
    sys.modules[name] = None

import concurrent.futures, multiprocessing, threading
def refuse(*arguments, **given):
    raise RuntimeError("no threads here")
threading.Thread.start = refuse
concurrent.futures.Executor.submit = refuse
multiprocessing.Process.start = refuse

import doctest, inspect, json
import toposeam as ts
from public_names import public_names
from toposeam.heat import elimination
assert elimination.qdldl is None

tried, failed = {}, []
runner = doctest.DocTestRunner(verbose=False)
finder = doctest.DocTestFinder(recurse=True)
for name, value in public_names().items():
    if not (inspect.isfunction(value) or inspect.isclass(value)):
        continue
    module = sys.modules[value.__module__]
    for test in finder.find(value, name, module=module, globs=dict(vars(module))):
        said = []
        done = runner.run(test, out=said.append)
        tried[name] = tried.get(name, 0) + done.attempted
        if done.failed:
            failed.append("".join(said))

import numpy as np
solved, wrapped = [], elimination._unsymmetric
def counted(matrix):
    solved.append(matrix.shape[0])
    return wrapped(matrix)
elimination._unsymmetric = counted
rng = np.random.default_rng(0)
a, b = rng.random((2, 120, 140, 3))
mask_a, mask_b = np.ones((2, 120, 140), bool)
mask_b[:60, :70] = mask_a[70:, 90:] = False
for method in set(ts.seam.METHODS) - {"dp", "graph-cut"}:
    seam = ts.find_seam(a, b, mask_a=mask_a, mask_b=mask_b, method=method)
    assert 1 <= seam.optimum_ratio() < 1.2, (method, seam.optimum_ratio())
print(json.dumps([tried, failed, solved]))
"""


@pytest.mark.medium
def test_the_library_runs_without_libvips_qdldl_and_threads():
    beside = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", BLOCKED]
    done = subprocess.run(command, env=beside, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    tried, failed, solved = json.loads(done.stdout)
    assert not failed, "\n".join(failed)
    functions = {name for name, value in public_names().items() if inspect.isfunction(value)}
    assert {name for name in functions if not tried.get(name)} == set()
    assert len(functions) > 35
    assert solved, "no network was solved by SuperLU"
    assert sum(tried.values()) > 200

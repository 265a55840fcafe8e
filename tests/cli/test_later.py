"""Modules that are loaded when somebody uses them."""

import subprocess
import sys


def printed(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_what_a_stitch_never_uses_is_not_loaded(tmp_path):
    """Inside of NumPy's Fortran wrappers, tests and masked arrays there are modules of their own."""
    loaded = printed(
        "import sys; from toposeam_cli.app.registry import load; load('stitch')\n"
        "import toposeam; toposeam.stitch; print(*sys.modules)"
    ).split()
    assert {"numpy.f2py", "numpy.ma", "numpy.testing", "toposeam.layers.composite.stitch"} <= set(loaded)
    assert not {"numpy.f2py.f2py2e", "numpy.ma.core", "unittest", "importlib.metadata"} & set(loaded)


def test_what_is_loaded_later_is_there_when_it_is_used():
    code = (
        "import numpy as np; from toposeam_cli.app.registry import loaded_later; loaded_later()\n"
        "import scipy.sparse\n"
        "print(np.ma.masked_equal([1, 2], 2).sum(), np.polynomial.Polynomial([1, 2])(3))\n"
        "from numpy.testing import assert_equal; assert_equal(1, 1); import numpy.ma.core, numpy.f2py\n"
        "print(np.ma is numpy.ma, callable(numpy.f2py.run_main))"
    )
    assert printed(code).split() == ["1", "7.0", "True", "True"]


def test_what_is_there_already_stays_what_it_is():
    code = (
        "import sys, numpy.ma, numpy.testing; before = numpy.ma, numpy.testing\n"
        "from toposeam_cli.app.registry import loaded_later\n"
        "loaded_later(('numpy.ma', 'numpy.testing', 'numpy.none'))\n"
        "print((numpy.ma, numpy.testing) == before, 'numpy.none' in sys.modules)"
    )
    assert printed(code).split() == ["True", "False"]

"""Modules that are loaded when somebody uses them; what is wrong is told before numerics load."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

SAMPLES = Path(__file__).parents[2] / "samples"
#: What no stitch of two photographs uses: large results, many layers, projects and layouts, other engines.
UNUSED = (
    "toposeam.layers.blending.gradient_domain",
    "toposeam.layers.composite.many_layers",
    "toposeam.layers.search.expansion_moves",
    "toposeam.layers.search.multilevel",
    "toposeam.seam.heat.method",
    "toposeam.seam.thesis.method",
    "toposeam.seam.thesis.options",
    "toposeam.vector.svg",
    "toposeam_cli.jobs.crew",
    "toposeam_cli.jobs.dask_workers",
    "toposeam_cli.media.layouts.any_layout",
    "toposeam_cli.media.layouts.hugin_project",
    "toposeam_cli.media.layouts.layout",
    "toposeam_cli.media.pictures.deep_zoom",
    "toposeam_cli.media.pictures.openraster",
    "toposeam_cli.media.pictures.stored",
    "toposeam_cli.stitching.file_sink",
    "toposeam_cli.stitching.saved_layout",
    "toposeam_cli.stitching.seam_page",
    "dask",
    "distributed",
    "matplotlib",
    "pydoc",
    "unittest",
)


def printed(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def loaded(*words: object) -> set[str]:
    """The modules that a command has loaded at its end."""
    code = (
        "import sys\nfrom toposeam_cli.app.main import main\n"
        f"try: main({[str(word) for word in words]!r})\n"
        "except SystemExit: pass\nprint('loaded', *sys.modules)"
    )
    return set(printed(code).rpartition("loaded ")[2].split())


@pytest.mark.medium
def test_a_stitch_loads_what_it_uses(tmp_path):
    assert all(find_spec(name) for name in UNUSED if name.startswith("toposeam"))
    out = tmp_path / "out.png"
    pictures = [SAMPLES / f"coffee_{one}.jpg" for one in "ab"]
    modules = loaded("stitch", *pictures, "-o", out, "-q")
    assert out.exists()
    assert modules.isdisjoint(UNUSED), sorted(modules.intersection(UNUSED))


@pytest.mark.medium
@pytest.mark.parametrize(
    "words",
    [
        ("--bogus", "a.png", "b.png"),
        ("a.png", "b.png", "-o", "c.png", "--method", "bogus"),
        ("a.png", "b.png", "-o", "c.xyz"),
        ("a.png", "b.png", "-o", "c.png"),
        ("--help",),
    ],
    ids=["option", "value", "output", "file", "help"],
)
def test_what_is_wrong_is_told_before_numerics_load(words):
    assert not loaded("stitch", *words) & {"numpy", "scipy", "pyvips", "PIL"}


@pytest.mark.medium
@pytest.mark.parametrize("command", ["fill", "synth", "tile", "motif"])
def test_a_wrong_option_is_told_before_what_grows(command):
    slow = {"scipy.spatial", "skimage.morphology", "skimage.draw", "toposeam.texture.material"}
    if command != "motif":
        slow |= {"scipy.sparse", "scipy.ndimage", "scipy.fft", "toposeam.heat.network"}
    assert not loaded(command, "a.png", "--bogus") & slow


def test_what_a_stitch_never_uses_is_not_loaded(tmp_path):
    """Inside of NumPy's Fortran wrappers, tests and masked arrays there are modules of their own."""
    loaded = printed(
        "import sys; from toposeam_cli.app.registry import numerics_loading\n"
        "with numerics_loading(): import toposeam; toposeam.stitch\nprint(*sys.modules)"
    ).split()
    assert {"numpy.f2py", "numpy.ma", "numpy.testing", "toposeam.layers.composite.stitching"} <= set(loaded)
    assert not {"numpy.f2py.f2py2e", "numpy.ma.core", "unittest", "importlib.metadata", "pydoc"} & set(loaded)


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


def test_numerics_load_without_parsing_docstrings():
    code = (
        "import sys; from toposeam_cli.app.registry import numerics_loading\n"
        "with numerics_loading(): import scipy.ndimage, scipy.fft, scipy.optimize\n"
        "print('pydoc' in sys.modules, scipy.fft.fft.__doc__.split()[0])\n"
        "import scipy.stats; print(scipy.stats.norm.cdf(0), 'pydoc' in sys.modules)"
    )
    assert printed(code).split() == ["False", "Compute", "0.5", "True"]

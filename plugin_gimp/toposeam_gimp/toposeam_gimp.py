#!/usr/bin/env python3
"""Executable that GIMP runs. The folder itself becomes importable as the package that it is."""

import os
import sys

import gi

for _name, _version in (("Babl", "0.1"), ("Gegl", "0.4"), ("Gimp", "3.0")):
    gi.require_version(_name, _version)
from gi.repository import Gimp  # noqa: E402

# Python puts this folder itself on the path, where this file would hide the package.
_here = os.path.dirname(os.path.realpath(__file__))  # noqa: PTH120
sys.path[:] = [place for place in sys.path if os.path.realpath(place) != _here] + [os.path.dirname(_here)]  # noqa: PTH120
from toposeam_gimp.engine.launching import protect  # noqa: E402
from toposeam_gimp.plugin import TopoSeam  # noqa: E402

protect(os.environ)
Gimp.main(TopoSeam.__gtype__, sys.argv)

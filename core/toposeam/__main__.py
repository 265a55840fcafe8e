"""``python -m toposeam``: the command line, of which nothing else in here knows."""

from importlib import import_module

import_module("toposeam_cli.__main__").start()

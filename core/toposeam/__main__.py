"""``python -m toposeam``: the command line, where it is installed."""

from importlib.metadata import distribution

(command,) = distribution("toposeam").entry_points.select(group="console_scripts", name="toposeam")
command.load()()

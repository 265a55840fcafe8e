"""``python -m toposeam``: the command line, where it is installed."""

from importlib.metadata import entry_points

(command,) = entry_points(group="console_scripts", name="toposeam")
command.load()()
